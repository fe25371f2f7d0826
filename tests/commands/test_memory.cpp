// Address space of many sizes: a command is done, or says in one line that memory ran out, and nothing it leaves is torn.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <regex>
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

/// Whether the program's libraries can begin under a limit: that of oneTBB 2022 ends by a signal before main() otherwise.
bool libraries_begin(const std::string& limit) {
  static std::map<std::string, bool> known;
  const auto [at, is_new] = known.try_emplace(limit, false);
  if (!is_new) return at->second;
  const int state =
      std::system(fmt::format("exec >/dev/null 2>&1 </dev/null; ulimit {}; exec {} --version", limit, LAMINA_PROGRAM).c_str());
  return at->second = WIFEXITED(state) && WEXITSTATUS(state) != 127;
}

// tests/torture/readers.py does this for every reader and with more limits.
TEST(Limits, ReadersThatLackMemoryOrOpenFilesNameWhatTheyNeed) {
  const Directory folder;
  int complete = 0, lacks_memory = 0, lacks_files = 0;
  for (const char* input :
       {"images3/I02_gray8_trns_bg/layer_0000.png", "images3/I12_thumb_second/layer_0000.tif", "images3/I25b_pbm_trailing",
        "images3/J02_bmp_white_white", "quad_knot.obj", "nist_part_feature_open.stl", "arrow_scaled_mirrored.3mf"}) {
    std::string whole;
    for (const std::string limit :
         {"-n 64", "-v 16000", "-v 19000", "-v 22000", "-v 26000", "-v 36000", "-n 4", "-n 5", "-n 8"}) {
      if (!libraries_begin(limit)) continue;
      const std::string out = folder / "out", err = folder / "err";
      const int state = std::system(fmt::format("exec >{} 2>{} </dev/null; ulimit {}; exec {} info {}", out, err, limit,
                                                LAMINA_PROGRAM, corpus_file(input))
                                        .c_str());
      const int code = WIFEXITED(state) ? WEXITSTATUS(state) : -1;
      const std::string what = std::string(input) + ", ulimit " + limit + ": " + read_text(err), answer = read_text(out);
      if (code == 127 || read_text(err).starts_with("\nlibgomp: ")) continue;  // nothing is left for the program's libraries
      if (whole.empty()) whole = answer;
      if (code == 0) {
        EXPECT_EQ(answer, whole) << what;
        ++complete;
        continue;
      }
      ASSERT_EQ(code, 6) << what;
      EXPECT_TRUE(std::regex_search(what, std::regex(": needs more than [0-9]+( MiB of address space;|; raise the limit)")))
          << what;
      EXPECT_EQ(std::ranges::count(read_text(err), '\n'), 1) << what;
      ++(limit[1] == 'v' ? lacks_memory : lacks_files);
    }
  }
  EXPECT_GE(complete, 21);
  EXPECT_GT(lacks_memory, 0);
  EXPECT_GT(lacks_files, 0);
}

}  // namespace
}  // namespace lamina::test
