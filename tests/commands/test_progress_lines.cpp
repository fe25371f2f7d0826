// tests/commands/test_progress_lines.cpp: with --progress json every line of standard error is an object, the last one the exit
// code.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

std::vector<nlohmann::json> error_objects(const Outcome& outcome) {
  std::vector<nlohmann::json> lines;
  std::istringstream text(outcome.err);
  for (std::string line; std::getline(text, line);) {
    lines.push_back(nlohmann::json::parse(line, nullptr, false));
    EXPECT_TRUE(lines.back().is_object()) << line;
  }
  return lines;
}

TEST(ProgressLines, ReportStagesMessagesAndTheExitCode) {
  const Directory directory;
  write_box(directory / "part.stl", {0, 0, 0}, {6, 4, 3});
  write_text(directory / "jobs.txt", "jet part.stl --bed 40x40 --dpi 300\ninfo absent.stl\n");
  for (const auto& [line, stage, total, code] :
       {std::tuple{"jet part.stl --bed 40x40 --dpi 300 --layer 0.1 -o out --quiet", "layers", 30, 0},
        {"slice part.stl --layer 0.1 -o sliced", "layers", 30, 0},
        {"batch jobs.txt -o many", "jobs", 2, 3}}) {
    const auto lines = error_objects(run_lamina(words_of(std::string(line) + " --progress json"), directory.path()));
    ASSERT_GE(lines.size(), 2u) << line;
    EXPECT_EQ(lines.back().at("event"), "end") << line;
    EXPECT_EQ(lines.back().at("code"), code) << line;
    int done = -1, of = -1;
    for (const auto& one : lines) {
      if (one.at("event") != "progress" || one.at("stage") != stage) continue;
      EXPECT_GT(one.at("done").get<int>(), done) << line;
      done = one.at("done").get<int>(), of = one.at("total").get<int>();
    }
    EXPECT_EQ(done, total) << line;
    EXPECT_EQ(of, total) << line;
  }
  expect_refused("jet part.stl -o none --progress xml", 2, "'xml' is no kind of progress", directory);
  const auto refused = error_objects(run_lamina(words_of("jet absent.stl -o none --progress json"), directory.path()));
  ASSERT_GE(refused.size(), 2u);
  EXPECT_EQ(refused[refused.size() - 2].at("event"), "error");
  EXPECT_EQ(refused[refused.size() - 2].at("code"), 3);
  EXPECT_EQ(refused.back().at("code"), 3);
}

}  // namespace
}  // namespace lamina::test
