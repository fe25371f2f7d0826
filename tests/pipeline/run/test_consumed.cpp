// lamina stream --consume: no layer is deleted that its host has not received.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "pipeline/check/consumed.h"
#include "stages/support/io/temporary.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

/// A call of lamina stream whose output this process reads.
class HostedStream {
 public:
  HostedStream(const fs::path& folder, bool socket) {
    int ends[2] = {};
    EXPECT_EQ(socket ? ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) : ::pipe2(ends, O_CLOEXEC), 0);
    process_ = ::fork();
    if (process_ == 0) {
      ::dup2(ends[1], 1);
      if (::chdir(folder.c_str()) == 0) ::execl(LAMINA_PROGRAM, "lamina", "stream", "out", "--consume", "--quiet", nullptr);
      ::_exit(127);
    }
    ::close(ends[1]);
    from_ = ends[0];
  }
  ~HostedStream() { ::close(from_); }
  /// false at the end
  bool read(std::size_t max_bytes) {
    std::string piece(max_bytes, '\0');
    const ssize_t got = ::read(from_, piece.data(), piece.size());
    if (got > 0) received.append(piece, 0, static_cast<std::size_t>(got));
    return got > 0;
  }
  void kill() const { ::kill(process_, SIGKILL); }
  int wait() const {
    int status = 0;
    ::waitpid(process_, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string received;

 private:
  int from_ = -1;
  pid_t process_ = -1;
};

class ConsumedJobs : public testing::Test {
 protected:
  /// 51 layers of 12 kB: five of them wait in a pipe.
  ConsumedJobs() {
    test::write_text(
        folder_ / "raw.toml",
        "[machine]\nname = \"printer\"\ndialect = \"raw\"\n[bed]\nsize_mm = [20, 12]\nbuild_height_mm = 50\n[head]\n"
        "nozzles = 120\npitch_um = 50\ndrop_pl = 85\n[powder]\npacking = 0.6\n");
    test::write_box(folder_ / "box.stl", {0, 0, 0}, {9.03f, 8.06f, 1.03f});
    plan();
    program_.push_back(test::read_text(folder_ / "out/program/start.raw"));
    for (std::uint32_t layer = 0; fs::exists(program_of(layer)); ++layer)
      program_.push_back(test::read_text(program_of(layer)));
    program_.push_back(test::read_text(folder_ / "out/program/end.raw"));
  }
  void plan() const {
    const std::string line =
        "jet box.stl --machine raw.toml --layer 0.02 --set program.compress=false --quiet --overwrite -o out";
    EXPECT_EQ(test::run_lamina(test::words_of(line), folder_.path()).code, 0);
  }
  fs::path program_of(std::uint32_t layer) const { return folder_.path() / fmt::format("out/program/{:06}.raw", layer); }
  fs::path image_of(std::uint32_t layer) const { return folder_.path() / fmt::format("out/layers/{:06}.tif", layer); }
  std::uint32_t layers() const { return static_cast<std::uint32_t>(program_.size()) - 2; }
  pipeline::Delivered delivered() const { return *pipeline::read_delivered(folder_ / "out"); }
  /// What a call sends that begins with this file of the program.
  std::string program_from(std::size_t file) const {
    std::string text;
    for (; file < program_.size(); ++file) text += program_[file];
    return text;
  }
  void refused(const std::string& line, int code, const std::string& words) const {
    test::expect_refused(line, code, words, folder_);
  }
  test::Directory folder_;
  std::vector<std::string> program_;  // start, layers, end
};

TEST_F(ConsumedJobs, KilledCallsDeleteNothingThatWasNotReceived) {
  ASSERT_EQ(layers(), 52u);
  std::mt19937 random(7);
  std::vector<char> received(layers(), 0);
  for (int trial = 0; trial <= 20; ++trial) {
    const pipeline::Delivered known = delivered();
    const std::size_t first = known.start ? known.layers + 1 : 0;
    HostedStream stream(folder_.path(), trial % 4 == 3);
    for (auto reads = random() % 5; trial < 20 && reads > 0; --reads) {
      stream.read(1 + random() % 9000);
      ::usleep(static_cast<useconds_t>(random() % 3000));
    }
    if (trial < 20) {
      stream.kill();
    } else {
      while (stream.read(1 << 16)) continue;
    }
    EXPECT_EQ(stream.wait(), trial < 20 ? -1 : 0);
    EXPECT_TRUE(program_from(first).starts_with(stream.received)) << "trial " << trial << " from " << first;
    std::size_t end = 0;
    for (std::size_t file = first; file + 1 < program_.size(); ++file) {
      end += program_[file].size();
      if (file > 0 && end <= stream.received.size()) received[file - 1] = 1;
    }
    for (std::uint32_t layer = 0; layer < layers(); ++layer) {
      EXPECT_TRUE(received[layer] || (fs::exists(program_of(layer)) && fs::exists(image_of(layer)))) << trial << ": " << layer;
      EXPECT_TRUE(received[layer] || layer >= delivered().layers) << trial << ": " << layer;
    }
  }
  EXPECT_TRUE(delivered().end && !fs::exists(program_of(layers() - 1)) && !fs::exists(image_of(0)));
  EXPECT_TRUE(fs::exists(folder_ / "out/manifest.json") && fs::exists(folder_ / "out/program/machine.toml"));
  refused("verify out", 5, "out: all 52 layers were delivered and deleted by lamina stream --consume");
  HostedStream again(folder_.path(), false);
  EXPECT_FALSE(again.read(1));
  EXPECT_EQ(again.wait(), 0);
}

TEST_F(ConsumedJobs, LayersBeforeADamagedOneAreDelivered) {
  const std::string good = test::read_text(program_of(7));
  test::write_text(program_of(7), "damaged");
  HostedStream stream(folder_.path(), false);
  while (stream.read(100'000)) continue;
  EXPECT_EQ(stream.wait(), 5);
  EXPECT_EQ(delivered().layers, 7u);
  EXPECT_TRUE(!fs::exists(program_of(6)) && fs::exists(program_of(7)));
  refused("stream out -o whole", 5,
          "layers 0 to 6 of 52 were delivered and deleted by lamina stream --consume; continue with it");
  test::write_text(program_of(7), good);
  refused("verify out", 5, "layers 0 to 6 of 52 were delivered and deleted by lamina stream --consume");
  // A torn line does not count, and what a killed call left of a delivered layer is deleted.
  test::write_text(folder_ / "out/consumed.jsonl", test::read_text(folder_ / "out/consumed.jsonl") + "{\"job\":\"");
  test::write_text(program_of(6), "left");
  HostedStream rest(folder_.path(), false);
  while (rest.read(100'000)) continue;
  EXPECT_EQ(rest.wait(), 0);
  EXPECT_TRUE(rest.received == program_from(8));
  EXPECT_TRUE(delivered().end && !fs::exists(program_of(6)));
  plan();
  EXPECT_TRUE(delivered().earlier);
  HostedStream replanned(folder_.path(), false);
  EXPECT_FALSE(replanned.read(1));
  EXPECT_EQ(replanned.wait(), 2);
  EXPECT_TRUE(fs::exists(program_of(0))) << "the record is of the earlier plan";
}

TEST_F(ConsumedJobs, OutputsThatReportNothingAndJobsInUseAreRefused) {
  refused("stream out --consume -o whole", 2, "--consume: the output must be a pipe");
  refused("stream out --consume -o /dev/null", 2, "--consume: the output must be a pipe");
  const auto claim = Claim::take(folder_ / "out/manifest.json", "out");
  ASSERT_TRUE(claim.ok());
  refused("stream out --consume", 4, "out: ");
  EXPECT_TRUE(fs::exists(program_of(0)));
  EXPECT_EQ(test::run_lamina({"verify", "out", "--quick"}, folder_.path()).code, 0) << "of a job that is claimed";
}

}  // namespace
}  // namespace lamina
