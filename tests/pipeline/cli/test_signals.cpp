#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>

#include "pipeline/cli/console.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "tests/formats/images.h"

namespace lamina {
namespace {

TEST(Signals, ASignalThatEndsTheProgramLeavesNothingButWhatCanBeContinued) {
  const formats::testing::Folder folder;
  for (const int signal : {SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXCPU, SIGALRM, SIGUSR1}) {
    const pid_t child = ::fork();
    if (child == 0) {
      const rlimit none{0, 0};
      ::setrlimit(RLIMIT_CORE, &none);
      for (const int one : {SIGHUP, SIGINT, SIGQUIT}) std::signal(one, SIG_DFL);  // not as the tests were started
      pipeline::handle_signals();
      const auto file = File::open(folder / "part.gcode"), layer = File::open(folder / "layer.tif", {.lock = false});
      const auto kept = File::open(folder / "kept.gcode", {.keep_part = true});
      const auto claim = Claim::take(folder / "manifest.json", "");
      if (file && layer && kept && claim) ::raise(signal);
      ::_exit(1);
    }
    int result = 0;
    ASSERT_EQ(::waitpid(child, &result, 0), child);
    EXPECT_TRUE(WIFSIGNALED(result) && WTERMSIG(result) == signal) << result;
    EXPECT_EQ(folder.files(), 1u) << signal;
    EXPECT_TRUE(std::filesystem::exists(folder / "kept.gcode.part"));
  }
}

}  // namespace
}  // namespace lamina
