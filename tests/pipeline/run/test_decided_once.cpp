// In one run the machine, the output, the layers and the filling are each decided once; at ef3e1c3 it was up to three times.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/job/decisions.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

struct Row {
  const char* name;
  bool has_machine;
  std::vector<std::string> words;  // command first
  const char* output;
};

struct DecidedOnce : testing::TestWithParam<Row> {};

TEST_P(DecidedOnce, EachByTheWholeCommand) {
  const Row& row = GetParam();
  const test::Directory folder;
  std::vector<std::string> words(row.words.begin() + 1, row.words.end());
  for (const std::string& word : {std::string(LAMINA_TEST_DIR) + "/corpus/dental_crown.stl", std::string("-o"),
                                  folder / row.output, std::string("--quiet")}) {
    words.push_back(word);
  }
  constexpr Decision kAll[] = {Decision::kMachine, Decision::kOutput, Decision::kHeights, Decision::kFilling};
  std::uint64_t before[4];
  for (int i = 0; i < 4; ++i) before[i] = times(kAll[i]);
  Console console;
  const Outcome outcome = run_command(*find_command(row.words.front()), words, console);
  ASSERT_EQ(outcome.code, 0) << (outcome.error ? outcome.error->message : "");
  EXPECT_EQ(times(Decision::kMachine) - before[0], row.has_machine ? 1 : 0);
  EXPECT_EQ(times(Decision::kOutput) - before[1], 1);
  EXPECT_EQ(times(Decision::kHeights) - before[2], 1);
  EXPECT_EQ(times(Decision::kFilling) - before[3], 1);  // of one part
}

const Row kRows[] = {
    {"JetOnAMachine", true, {"jet", "--machine", "nuferbj", "--layer", "0.5"}, "out"},
    {"JetFilled", false, {"jet", "--bed", "16x16", "--dpi", "300", "--layer", "0.5", "--fill", "raster"}, "out"},
    {"JetWithFittedLayersFilled",
     false,
     {"jet", "--bed", "16x16", "--dpi", "300", "--heights", "cusp", "--thickness", "0.2..0.6", "--fill", "raster"},
     "out"},
    {"Slice", false, {"slice", "--heights", "cusp", "--thickness", "0.2..0.6"}, "out"},
    {"ExtrudeGcode", true, {"extrude", "--machine", "anet-a8", "--layer", "0.2", "--fill", "raster"}, "part.gcode"},
    {"ExtrudeGcodeByTheMachinesOwnLayer", true, {"extrude", "--machine", "anet-a8", "--fill", "segmented"}, "part.gcode"},
    {"ExtrudeSml", true, {"extrude", "--machine", "fdm-2000", "--layer", "0.254", "--fill", "raster"}, "part.sml"},
};
INSTANTIATE_TEST_SUITE_P(Products, DecidedOnce, testing::ValuesIn(kRows),
                         [](const testing::TestParamInfo<Row>& row) { return std::string(row.param.name); });

}  // namespace
}  // namespace lamina::pipeline
