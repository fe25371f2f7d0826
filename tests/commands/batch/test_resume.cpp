// tests/commands/batch/test_resume.cpp: a batch that is killed, interrupted, out of disk, or disturbed resumes where
// it was, to the same bytes.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <sstream>
#include <thread>
#include <tuple>

#include "tests/commands/batch/batch.h"

namespace lamina::test {
namespace {

TEST_F(JobsInBatch, KilledFiveTimesItIsResumedToTheSameBytesAndNothingIsDoneTwice) {
  constexpr int kJobs = 12, kKills = 5;
  write_boxes(kJobs);
  const Words job = {"--with", "jet --bed 60x60 --dpi 600 --layer 0.008 --format png", "--jobs", "2", "--quiet"};
  Words parts;
  for (int i = 10; i < 10 + kJobs; ++i) parts.push_back("part" + std::to_string(i) + ".stl");
  const auto batch = [&](const std::string& output, const Words& more) {
    Words words = parts;
    words.insert(words.end(), {"-o", output});
    words.insert(words.end(), more.begin(), more.end());
    return batch_of(words, job);
  };
  const auto layers_in = [&](const std::string& output) {
    const std::vector<std::string> files = files_below(directory_ / output);
    return std::ranges::count_if(files, [](const std::string& file) { return file.ends_with(".png"); });
  };
  // Files that are written again, be it with the same bytes, get another number or time.
  using Stamps = std::map<std::string, std::tuple<ino_t, time_t, long>>;
  const auto stamps = [&](const std::string& position) {
    Stamps found;
    for (const std::string& file : files_below(directory_ / position)) {
      struct stat status {};
      EXPECT_EQ(::stat((directory_ / (position + "/" + file)).c_str(), &status), 0) << file;
      found[file] = {status.st_ino, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
    }
    return found;
  };
  const auto times_ended = [&] {
    std::map<std::string, int> times;
    std::istringstream record(read_text(directory_ / "out/batch.jsonl"));
    for (std::string line; std::getline(record, line);) {
      const Json json = Json::parse(line, nullptr, false);
      if (json.is_object() && json.contains("ended")) ++times[json["output"]];
    }
    return times;
  };
  ASSERT_EQ(lamina(batch("whole", {})).code, 0);
  const double all = static_cast<double>(layers_in("whole"));

  // Each kill comes once so many layers are there, at any step of the batch: the last one long before it
  // could end.
  std::mt19937 random(20261);
  std::uniform_real_distribution<> within(0.1, 0.9);
  std::map<std::string, Stamps> finished;
  for (int kill = 0; kill < kKills; ++kill) {
    const auto enough = static_cast<std::ptrdiff_t>(all * 0.75 * (kill + within(random)) / kKills);
    const auto delay = std::chrono::duration<double, std::milli>(20 * within(random));
    const Outcome outcome = lamina(batch("out", {"--resume"}), [&](int process) {
      siginfo_t ended{};
      while (layers_in("out") < enough &&
             (::waitid(P_PID, static_cast<id_t>(process), &ended, WEXITED | WNOHANG | WNOWAIT) != 0 || ended.si_pid == 0)) {
        std::this_thread::sleep_for(std::chrono::milliseconds(3));
      }
      std::this_thread::sleep_for(delay);
      ::kill(process, SIGKILL);
    });
    ASSERT_EQ(outcome.code, 128 + SIGKILL) << "kill " << kill << ": " << outcome.err;
    ASSERT_LT(layers_in("out"), layers_in("whole"));
    for (const auto& [name, times] : times_ended()) finished.try_emplace(name, stamps("out/" + name));
  }
  EXPECT_GE(finished.size(), 4u);  // so the kills were spread over the jobs
  EXPECT_LT(finished.size(), kJobs);
  ASSERT_EQ(lamina(batch("out", {"--resume"})).code, 0);
  EXPECT_EQ(tree("out"), tree("whole"));
  for (const auto& [name, then] : finished) EXPECT_EQ(stamps("out/" + name), then) << name << " was written again";
  EXPECT_EQ(times_ended().size(), kJobs);
  for (const auto& [name, times] : times_ended()) EXPECT_EQ(times, 1) << name;
  const Words last = outcomes("out");
  EXPECT_EQ(std::ranges::count(last, "kept"), static_cast<std::ptrdiff_t>(finished.size()));
  EXPECT_EQ(lamina(batch("out", {"--resume"})).code, 0);
  EXPECT_EQ(outcomes("out"), Words(kJobs, "kept"));
}

/// A file system of its own, so small that it is soon full.
class SmallDisk {
 public:
  explicit SmallDisk(const std::string& position) : position_(position) {
    fs::create_directories(position_);
    mounted_ = ::mount("tmpfs", position_.c_str(), "tmpfs", 0, "size=192k") == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(position_.c_str(), MNT_DETACH);
  }
  bool mounted() const { return mounted_; }
  bool grow() const { return ::mount("tmpfs", position_.c_str(), "tmpfs", MS_REMOUNT, "size=64m") == 0; }

 private:
  std::string position_;
  bool mounted_;
};

TEST_F(JobsInBatch, AFullDiskIsOneLineTheRestIsUnharmedAndWithSpaceItContinues) {
  const SmallDisk disk(directory_ / "disk");
  if (!disk.mounted()) GTEST_SKIP() << "NOT RUN: a batch on a full disk; mounting a tmpfs needs root";
  write_boxes(3);
  const std::string options = " --bed 60x60 --dpi 300 --layer 0.01";
  // One job's output is on the disk that gets full.
  write_text(directory_ / "list.txt", "jet part10.stl" + options + " -o a\njet part11.stl" + options + " -o " +
                                          directory_ / "disk/b" + "\njet part12.stl" + options + " -o c\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out"});
  EXPECT_EQ(outcome.code, 4);
  Json json = summary("out");
  EXPECT_EQ(outcomes("out"), (Words{"done", "failed", "done"}));
  const std::string reason = json["jobs"][1]["reason"];
  EXPECT_NE(reason.find("No space left on device); free some space; finished layers are kept, continue with --resume"),
            std::string::npos)
      << reason;
  EXPECT_EQ(reason.find('\n'), std::string::npos);
  EXPECT_EQ(lamina({"verify", "out/a", "out/c", "--quiet"}).code, 0);

  // The whole batch is.
  fs::remove_all(directory_ / "disk/b");
  const Words all = {"part10.stl", "part11.stl", "part12.stl", "--with", "jet" + options, "--quiet"};
  ASSERT_EQ(lamina(batch_of({"-o", "whole"}, all)).code, 0);
  const Outcome full = lamina(batch_of({"-o", "disk/out"}, all));
  EXPECT_EQ(full.code, 4) << full.err;
  EXPECT_NE(full.err.find("No space left on device); free some space"), std::string::npos) << full.err;
  for (const std::string& file : files_below(directory_ / "disk")) EXPECT_FALSE(file.ends_with(".tif.part")) << file;
  ASSERT_TRUE(disk.grow());
  const Outcome resumed = lamina(batch_of({"-o", "disk/out", "--resume"}, all));
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_EQ(tree("disk/out"), tree("whole"));
}

TEST_F(JobsInBatch, ResumeDoesAgainWhatHasChangedSince) {
  write_boxes(4);
  ASSERT_EQ(lamina(batch_of({"part10.stl", "part11.stl", "part12.stl", "part13.stl", "-o", "out"})).code, 0);
  write_box(directory_ / "part11.stl", {0, 0, 0}, {9, 3, 1});         // another part
  write_text(directory_ / "out/part12/layers/000003.tif", "damage");  // another layer
  fs::remove(directory_ / "out/part13/layers/000000.tif");
  const Outcome outcome = lamina(batch_of({"part10.stl", "part11.stl", "part12.stl", "part13.stl", "-o", "out", "--resume"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcomes("out"), (Words{"kept", "done", "done", "done"}));
  ASSERT_EQ(lamina(batch_of({"part10.stl", "part11.stl", "part12.stl", "part13.stl", "-o", "fresh"})).code, 0);
  EXPECT_EQ(tree("out"), tree("fresh"));
  EXPECT_EQ(lamina(batch_of({"part10.stl", "-o", "out"})).code, 2);  // an earlier batch
  EXPECT_EQ(lamina(batch_of({"part10.stl", "-o", "out", "--overwrite"})).code, 0);
}

TEST_F(JobsInBatch, WithoutItsRecordABatchRecognizesWhatIsDoneAndLeavesOtherJobsAlone) {
  write_boxes(6);
  const std::string options = " --bed 60x60 --dpi 300 --layer 0.1 --quiet -o ";
  const auto list = [&](const std::string& name, const std::string& fourth) {
    write_text(directory_ / name,
               "jet part10.stl" + options + "a\njet part11.stl" + options + "b\njet part12.stl" + options + "c\njet " + fourth +
                   options + "d\nslice part14.stl --layer 0.1 --quiet -o e\ninfo part14.stl\njet part15.stl" + options + "f\n");
  };
  list("list.txt", "part13.stl");
  ASSERT_EQ(lamina({"batch", "list.txt", "-o", "whole"}).code, 0);
  // One run by hand before there was a list, one cut short, one damaged, one of another part; the record is gone.
  ASSERT_EQ(lamina({"batch", "list.txt", "-o", "out"}).code, 0);
  fs::remove_all(directory_ / "out/a");
  ASSERT_EQ(lamina({"jet", "part10.stl", "--bed", "60x60", "--dpi", "300", "--layer", "0.1", "--quiet", "-o", "out/a"}).code,
            0);
  fs::rename(directory_ / "out/b/manifest.json", directory_ / "out/b/manifest.json.part");
  fs::remove(directory_ / "out/b/layers/000007.tif");
  write_text(directory_ / "out/c/layers/000003.tif", "damage");
  fs::remove_all(directory_ / "out/f");
  fs::remove(directory_ / "out/batch.jsonl");
  list("other.txt", "part15.stl");
  const std::string others = tree_text(directory_ / "out/d");
  Outcome outcome = lamina({"batch", "other.txt", "-o", "out", "--resume"});
  EXPECT_EQ(outcome.code, 2) << outcome.err;
  EXPECT_EQ(outcomes("out"), (Words{"kept", "done", "done", "failed", "kept", "done", "done"})) << outcome.err;
  const Json json = summary("out");
  EXPECT_NE(json["jobs"][3]["reason"].get<std::string>().find("out/d/manifest.json: belongs to another job"), std::string::npos)
      << outcome.err;
  EXPECT_EQ(tree_text(directory_ / "out/d"), others);
  // A second request does not make it the batch's own.
  const std::string slices = tree_text(directory_ / "out/e");
  EXPECT_EQ(lamina({"batch", "other.txt", "-o", "out", "--resume"}).code, 2);
  EXPECT_EQ(outcomes("out"), (Words{"kept", "kept", "kept", "failed", "kept", "kept", "kept"}));
  EXPECT_EQ(tree_text(directory_ / "out/d") + tree_text(directory_ / "out/e"), others + slices);
  fs::remove_all(directory_ / "out/e");
  outcome = lamina({"batch", "list.txt", "-o", "out", "--resume"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcomes("out"), (Words{"kept", "kept", "kept", "kept", "done", "kept", "kept"})) << outcome.err;
  EXPECT_EQ(tree("out"), tree("whole"));
  // Without --resume nothing that is there is taken for the batch's own.
  fs::remove(directory_ / "out/batch.jsonl");
  outcome = lamina({"batch", "list.txt", "-o", "out", "--quiet"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("out/a/manifest.json: a finished job"), std::string::npos) << outcome.err;
}

TEST_F(JobsInBatch, AfterACorrectedListOnlyItsJobsCount) {
  write_boxes(3);
  const std::string options = " --bed 60x60 --dpi 100 --layer 0.5 -o ";
  const auto status_after = [&](const std::string& list, int code) {
    write_text(directory_ / "list.txt", list);
    const Outcome outcome = lamina({"batch", "list.txt", "-o", "out", "--resume", "--quiet"});
    EXPECT_EQ(outcome.code, code) << outcome.err;
    const Outcome status = lamina({"batch", "out", "--status"});
    EXPECT_EQ(status.code, code) << status.err;
    EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, code);
    if (code == 0) {
      EXPECT_EQ(lamina({"verify", "out", "--quiet"}).code, 0);
    }
    return status.out;
  };
  const std::string a = "jet part10.stl" + options + "a\n", b = "jet part11.stl" + options + "b\n", c = "info part10.stl\n";
  EXPECT_EQ(status_after(a + "jet missing.stl -o c\n" + b + c + c, 3), "4 of 5 jobs done, 1 failed\n");
  EXPECT_EQ(status_after(a + "jet part12.stl" + options + "d\n" + b + c + c, 0), "5 of 5 jobs done\n");
  // A shorter list in another order, and the longer one again.
  EXPECT_EQ(status_after(c + b, 0), "2 of 2 jobs done\n");
  EXPECT_EQ(status_after(a + "jet part12.stl" + options + "d\n" + b + c + c, 0), "5 of 5 jobs done\n");
  EXPECT_EQ(outcomes("out"), Words(5, "kept"));
  // A job file that is refused, and repaired.
  write_text(directory_ / "j.toml", "no job");
  EXPECT_EQ(status_after(a + "jet --job j.toml\n", 2), "1 of 2 jobs done, 1 failed\n");
  ASSERT_EQ(
      lamina({"jet", "part10.stl", "--dpi", "100", "--layer", "0.5", "-o", "e", "--save-job", "g.toml", "--dry-run"}).code, 0);
  fs::rename(directory_ / "g.toml", directory_ / "j.toml");
  EXPECT_EQ(status_after(a + "jet --job j.toml\n", 0), "2 of 2 jobs done\n");
}

TEST_F(JobsInBatch, ABatchThatReplacesAnotherIsResumedAndReplacesItStill) {
  write_boxes(3);
  const std::string options = " --bed 60x60 --dpi 100 --layer ";
  const auto write_list = [&](const std::string& layer) {
    write_text(directory_ / "list.txt", "jet part10.stl" + options + layer + " -o a\njet nowhere.stl -o b\njet part11.stl" +
                                            options + layer + " -o c\n");
  };
  write_list("0.5");
  EXPECT_EQ(lamina({"batch", "list.txt", "-o", "out", "--quiet"}).code, 3);
  write_list("0.25");
  EXPECT_EQ(lamina({"batch", "list.txt", "-o", "out", "--quiet", "--overwrite", "--fail-fast", "--jobs", "1"}).code, 3);
  EXPECT_EQ(outcomes("out"), (Words{"done", "failed", "not run"}));
  EXPECT_EQ(lamina({"batch", "list.txt", "-o", "out", "--quiet", "--resume"}).code, 3);
  EXPECT_EQ(outcomes("out"), (Words{"kept", "failed", "done"}));
  // Another list replaces only what its record knows.
  ASSERT_EQ(lamina({"jet", "part12.stl", "--dpi", "100", "--layer", "0.5", "-o", "out/d", "--quiet"}).code, 0);
  write_text(directory_ / "list.txt", "jet part10.stl" + options + "0.25 -o a\njet part11.stl" + options + "0.25 -o d\n");
  EXPECT_EQ(lamina({"batch", "list.txt", "-o", "out", "--quiet", "--resume"}).code, 2);
  EXPECT_EQ(outcomes("out"), (Words{"kept", "failed"}));
}

TEST_F(JobsInBatch, TwoBatchesInOneDirectoryAreRefused) {
  write_boxes(1);
  fs::create_directories(directory_ / "out");
  const int file = ::open((directory_ / "out/batch.jsonl").c_str(), O_RDWR | O_CREAT, 0600);
  ASSERT_EQ(::flock(file, LOCK_EX), 0);
  const Outcome outcome = lamina(batch_of({"part10.stl", "-o", "out"}));
  EXPECT_EQ(outcome.code, 4);
  EXPECT_EQ(outcome.error_lines(), 1u);
  EXPECT_NE(outcome.err.find("another batch is running"), std::string::npos) << outcome.err;
  ::close(file);
  EXPECT_EQ(lamina(batch_of({"part10.stl", "-o", "out"})).code, 0);
}

TEST_F(JobsInBatch, InterruptedItSaysHowToGoOn) {
  write_boxes(1);
  const Words words =
      batch_of({"part10.stl", "-o", "out", "--resume"}, {"--with", "jet --bed 400x400 --dpi 1200 --layer 0.0002"});
  const Outcome outcome = lamina(words, [&](int process) {
    for (int i = 0; i < 2000 && !fs::exists(directory_ / "out/part10/layers/000000.tif"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    ::kill(process, SIGINT);
  });
  EXPECT_EQ(outcome.code, 130) << outcome.err;
  EXPECT_NE(outcome.err.find("--resume"), std::string::npos) << outcome.err;
  EXPECT_EQ(outcomes("out"), Words{"stopped"});
}

}  // namespace
}  // namespace lamina::test
