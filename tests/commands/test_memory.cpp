// Address space of many sizes: a command is done, or says in one line that memory ran out, and nothing it leaves is torn.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <sstream>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

class Memory : public ::testing::Test {
 protected:
  /// Runs a command in this many MB of address space; 0: without a limit.
  Outcome run(const std::string& line, rlim_t megabytes) const {
    rlimit before{};
    ::getrlimit(RLIMIT_AS, &before);
    if (megabytes > 0) {
      const rlimit limit{megabytes << 20, before.rlim_max};
      ::setrlimit(RLIMIT_AS, &limit);
    }
    std::istringstream stream(line);
    Outcome outcome = run_lamina({std::istream_iterator<std::string>(stream), {}}, directory_.path());
    ::setrlimit(RLIMIT_AS, &before);
    return outcome;
  }

  Directory directory_;
};

TEST_F(Memory, RunningOutOfItIsOneLineWithItsOwnCode) {
  const std::string part = LAMINA_TEST_DIR "/corpus/nist_am_test_artifact_v3b.stl";
  const std::string commands[] = {
      "jet " + part + " --dpi 300 --layer 0.5 --sync off --quiet -o ", "info " + part,
      "slice " + part + " --layer 0.5 --pattern contour --bead 0.2 --layers 0:2 --sync off --quiet -o "};
  for (const std::string& command : commands) {
    const bool writes = command.ends_with("-o ");
    ASSERT_EQ(run(writes ? command + "whole" : command, 0).code, 0);
    const std::string whole = tree_text(directory_ / "whole");
    int done = 0, short_of_memory = 0;
    for (const rlim_t megabytes : {16, 22, 27, 40, 78, 1000}) {
      const Outcome outcome = run(writes ? command + "out" : command, megabytes);
      const std::string what = command + std::to_string(megabytes) + " MB: " + outcome.err;
      // No room for the program's libraries, or for what one of them, muParser's OpenMP, wants before main() begins.
      if (outcome.code == 127 || outcome.err.starts_with("\nlibgomp: ")) continue;
      ++(outcome.code == 0 ? done : short_of_memory);
      if (outcome.code != 0) {
        EXPECT_EQ(outcome.code, 6) << what;
        EXPECT_NE(outcome.err.find("MiB of address space; give a smaller --memory"), std::string::npos) << what;
        EXPECT_EQ(outcome.error_lines(), 1u) << what;
        EXPECT_FALSE(fs::exists(directory_ / "out/manifest.json")) << what;
      } else if (writes) {
        EXPECT_EQ(tree_text(directory_ / "out"), whole) << what;
      }
      fs::remove_all(directory_ / "out");
    }
    EXPECT_GT(done, 0) << command;
    EXPECT_TRUE(!writes || short_of_memory > 0) << command;
    fs::remove_all(directory_ / "whole");
  }
}

}  // namespace
}  // namespace lamina::test
