// Images of layers that are decided while others are made: the same files as of layers decided first.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

/// A run that decides its layers while it makes them, and one that has them first, as --resume does.
TEST(StreamedLayers, WriteTheFilesOfLayersThatAreDecidedFirst) {
  const std::string part = corpus_file("quad_knot.obj");
  const std::vector<std::vector<std::string>> modes = {{"cusp", "--cusp", "0.05"},
                                                       {"stepwise", "--cusp", "0.05"},
                                                       {"angle", "--adapt-angle", "60"},
                                                       {"angle", "--adapt-angle", "60", "--cover-top"}};
  for (const std::vector<std::string>& mode : modes) {
    std::vector<std::string> outputs;
    for (const bool streams : {true, false}) {
      std::vector<std::string> arguments =
          words_of("jet " + part + " --bed 200x200 --dpi 75 --thickness 0.2,0.3,0.5 --json --timing --quiet -o out --heights");
      arguments.insert(arguments.end(), mode.begin(), mode.end());
      if (!streams) arguments.push_back("--resume");
      const Directory own;
      const Outcome outcome = run_lamina(arguments, own.path());
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      const nlohmann::json summary = nlohmann::json::parse(outcome.out, nullptr, false);
      EXPECT_EQ(summary["timing"]["nodes"].contains("heights"), streams);
      EXPECT_EQ(summary["layers_planned"], summary["layers_total"]);
      EXPECT_GT(summary["height_mm"], 10);
      outputs.push_back(tree_text(own.path() / "out"));
    }
    EXPECT_EQ(outputs[0], outputs[1]) << mode[0];
  }
}

}  // namespace
}  // namespace lamina::test
