// Many jobs in one queue: every one ends as it would alone, whatever happens to the others or to the batch.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <sstream>
#include <thread>
#include <tuple>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

class JobsInBatch : public ::testing::Test {
 protected:
  Outcome lamina(const Words& arguments, const std::function<void(int)>& watch = {}) {
    return run_lamina(arguments, directory_.path(), watch);
  }

  Json summary(const std::string& batch) {
    return Json::parse(read_text(directory_ / (batch + "/summary.json")), nullptr, false);
  }

  std::vector<std::string> outcomes(const std::string& batch) {
    std::vector<std::string> names;
    const Json json = summary(batch);
    for (const Json& job : json["jobs"]) names.push_back(job["outcome"]);
    return names;
  }

  // What the jobs wrote: all but what the batch says of itself.
  std::string tree(const std::string& batch) {
    std::string text;
    for (const auto& entry : fs::directory_iterator(directory_ / batch)) {
      if (entry.is_directory()) trees_[entry.path().filename()] = tree_text(entry.path());
    }
    for (auto& [name, files] : trees_) text += name + "\n" + files;
    trees_.clear();
    return text;
  }

  void write_boxes(int count) {
    for (int i = 0; i < count; ++i) {
      const float side = static_cast<float>(4 + i);
      write_box(directory_ / ("part" + std::to_string(10 + i) + ".stl"), {0, 0, 0}, {side, side, 2});
    }
  }

  std::map<std::string, std::string> trees_;
  Directory directory_;
};

const Words kSmall = {"--with", "jet --bed 60x60 --dpi 300 --layer 0.1", "--quiet"};

Words batch_of(Words words, const Words& more = kSmall) {
  words.insert(words.begin(), "batch");
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST_F(JobsInBatch, EveryFileOfTheCorpusEndsAsTheTableSaysAndAsItWouldAlone) {
  const fs::path corpus = fs::path(LAMINA_TEST_DIR) / "corpus";
  ASSERT_EQ(
      lamina(batch_of({corpus, "-o", "out"}, {"--with", "jet --bed 400x400 --dpi 60 --layer 1 --allow-empty", "--quiet"})).code,
      3);
  std::map<std::string, std::string> expected;
  std::ifstream table(corpus / "outcomes.tsv");
  for (std::string line; std::getline(table, line);) {
    std::istringstream cells(line);
    std::string file, outcome, code;
    cells >> file >> outcome >> code;
    expected[file] = code;
  }
  const Json json = summary("out");
  std::size_t done = 0;
  for (const Json& job : json["jobs"]) {
    const std::string file = fs::path(job["source"].get<std::string>()).lexically_relative(corpus);
    ASSERT_TRUE(expected.contains(file)) << file;
    EXPECT_EQ(std::to_string(job["code"].get<int>()), expected[file]) << file << ": " << job["reason"];
    EXPECT_EQ(job["code"] == 0, job["reason"] == "") << file;
    if (job["code"] != 0) continue;
    EXPECT_GT(job["result"]["layers_planned"], 0);
    if (done++ % 4 != 0) continue;
    ASSERT_EQ(lamina({"jet", corpus / file, "--bed", "400x400", "--dpi", "60", "--layer", "1", "--allow-empty", "--quiet", "-o",
                      "alone", "--overwrite"})
                  .code,
              0);
    EXPECT_EQ(tree_text(directory_ / "alone"), tree_text(directory_ / ("out/" + job["output"].get<std::string>()))) << file;
  }
  EXPECT_EQ(json["done"], done);
  EXPECT_EQ(json["jobs_total"], json["jobs"].size());
  EXPECT_LT(json["peak_resident_bytes"], json["memory_budget_bytes"]);
}

TEST_F(JobsInBatch, ListsJobFilesAndDirectoriesMakeOneQueueInOrder) {
  write_boxes(2);
  fs::create_directories(directory_ / "more/deep");
  write_box(directory_ / "more/deep/p.stl", {0, 0, 0}, {5, 5, 1});
  write_box(directory_ / "more/p.STL", {0, 0, 0}, {5, 5, 1});
  write_text(directory_ / "more/notes.txt", "no job");
  write_text(directory_ / "job.toml", "[bed]\nsize_mm=[40,40]\ndpi=100\n[[part]]\npath='part10.stl'\n");
  write_text(directory_ / "list.txt",
             "# comment\n\nlamina jet part10.stl --bed 40x40 --dpi 100 -o 'own place'\ninfo part11.stl\n"
             "jet part10.stl --bed 40x40 --dpi 100\njet part10.stl --bed 40x40 --dpi 100 --dry-run\n");
  const Outcome outcome = lamina(batch_of({"list.txt", "job.toml", "more", "part11.stl", "-o", "out"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json json = summary("out");
  Words outputs;
  for (const Json& job : json["jobs"]) outputs.push_back(job["output"]);
  EXPECT_EQ(outputs, (Words{"own place", "", "part10", "", "job", "deep_p", "p", "part11"}));
  EXPECT_EQ(json["jobs"][0]["source"], "list.txt:3");
  EXPECT_TRUE(json["jobs"][1]["result"].is_object());
  EXPECT_EQ(json["jobs"][3]["result"]["dry_run"], true);
  for (const char* name : {"own place", "job", "deep_p"})
    EXPECT_EQ(lamina({"verify", "out/" + std::string(name), "--quiet"}).code, 0) << name;
  const std::string table = read_text(directory_ / "out/summary.tsv");
  EXPECT_EQ(std::ranges::count(table, '\n'), 9);
}

TEST_F(JobsInBatch, AnyCommandIsAJobAndGivesItsValue) {
  write_boxes(2);
  write_text(directory_ / "list.txt",
             "slice part10.stl --layer 0.5 -o s\nextrude part10.stl --layer 0.2\nextrude part10.stl --machine fdm-2000\n"
             "heights part10.stl --layer 0.5\ninfo part10.stl part11.stl\ninfo nowhere.stl part10.stl gone.stl\n"
             "extrude part11.stl --layer 0.2 -o beads.gcode\nmanual jet -o pages\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out", "--json", "--quiet"});
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_EQ(std::ranges::count(outcome.out, '\n'), 1);
  const Json json = summary("out"), jobs = json["jobs"];
  EXPECT_EQ(Json::parse(outcome.out), json);
  Words outputs;
  for (const Json& job : jobs) outputs.push_back(job["output"]);
  EXPECT_EQ(outputs, (Words{"s", "part10.gcode", "part10.sml", "", "", "", "beads.gcode", "pages"}));
  for (const int i : {0, 1, 2, 6}) {
    EXPECT_GT(jobs[i]["result"]["layers_planned"], 0) << i;
    EXPECT_GT(jobs[i]["files"], 0) << i;
  }
  EXPECT_EQ(jobs[0]["result"]["command"], "slice");
  EXPECT_TRUE(jobs[3]["result"].is_string());
  ASSERT_EQ(jobs[4]["result"].size(), 2u);
  EXPECT_EQ(jobs[4]["result"][1]["path"], "part11.stl");
  // What can be said is said, and the reason is what went wrong first.
  EXPECT_EQ(jobs[5]["result"]["path"], "part10.stl");
  EXPECT_NE(jobs[5]["reason"].get<std::string>().find("nowhere.stl"), std::string::npos) << jobs[5]["reason"];
  ASSERT_EQ(lamina({"extrude", "part11.stl", "--layer", "0.2", "--quiet", "-o", "alone.gcode"}).code, 0);
  EXPECT_EQ(read_text(directory_ / "out/beads.gcode"), read_text(directory_ / "alone.gcode"));
}

TEST_F(JobsInBatch, WhatIsWrongWithOneJobIsOneLineAndTheRestIsUnharmed) {
  write_boxes(1);
  write_text(directory_ / "missing.toml", "[[part]]\npath='nowhere.stl'\n");
  write_text(directory_ / "wrong.toml", "[bed]\ndpy=3\n");
  write_text(directory_ / "file", "");
  fs::create_directories(directory_ / "half");
  write_text(directory_ / "half/manifest.json.part", "{\n");  // a job that is not finished
  write_text(directory_ / "list.txt",
             "jet part10.stl --bed 60x60 --dpi 0 -o a\njott part10.stl\njet --job missing.toml -o b\n"
             "jet --job wrong.toml\nbatch list.txt -o x\npreview out -o x.png\njet part10.stl --help\n"
             "jet part10.stl --bed 60x60 --dpi 100 -o " +
                 directory_ / "file/deeper" +
                 "\nverify nothing\nreport half -o page.html\n"
                 "jet part10.stl --bed 60x60 --dpi 100 -o good\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out"});
  EXPECT_EQ(outcome.code, 2);
  const Json json = summary("out");
  const int codes[] = {2, 2, 3, 2, 2, 2, 2, 4, 2, 5, 0};
  ASSERT_EQ(json["jobs"].size(), std::size(codes));
  for (std::size_t i = 0; i < std::size(codes); ++i) {
    const std::string reason = json["jobs"][i]["reason"];
    EXPECT_EQ(json["jobs"][i]["code"], codes[i]) << i << " " << reason;
    EXPECT_EQ(reason.empty(), codes[i] == 0) << i;
    EXPECT_NE(outcome.err.find(reason), std::string::npos) << reason;
  }
  EXPECT_EQ(lamina({"verify", "out/good"}).code, 0);
  // Each says where it is wrong and what to do.
  EXPECT_EQ(json["jobs"][2]["reason"],
            "missing.toml:2:6: part.path: nowhere.stl: no such file; correct it (a relative path begins beside the job file)");
  EXPECT_EQ(json["jobs"][9]["reason"], "half: the job is not finished; end it with --resume, then ask for the report");
}

TEST_F(JobsInBatch, WrongBatchesAreRefusedInOneLineBeforeAnythingRuns) {
  write_boxes(2);
  fs::create_directories(directory_ / "empty");
  write_text(directory_ / "empty.txt", "\n# nothing\n");
  write_text(directory_ / "quote.txt", "jet 'part10.stl\n");
  write_text(directory_ / "same.txt", "jet part10.stl -o a\njet part11.stl -o b/../a/\n");
  write_text(directory_ / "nested.txt", "jet part10.stl -o a\njet part11.stl -o a-b\njet part11.stl -o a/layers/c\n");
  write_text(directory_ / "own.txt", "jet part10.stl -o .\n");
  // Where the batch does not let its jobs write: out of its directory, and its own files.
  write_text(directory_ / "away.txt", "jet part10.stl -o a\njet part11.stl -o a/../../keep\n");
  write_text(directory_ / "above.txt", "jet part10.stl -o ..\n");
  write_text(directory_ / "record.txt", "jet part10.stl -o a\njet part11.stl -o batch.jsonl\n");
  write_text(directory_ / "summary.txt", "jet part10.stl -o b/../summary.json/\n");
  write_text(directory_ / "table.txt", "jet part10.stl -o " + directory_ / "out/summary.tsv/deep/er" + "\n");
  const std::pair<Words, std::string> cases[] = {
      {{"away.txt"}, "away.txt:2: -o leads out of out, to keep"},
      {{"above.txt"}, "has to be an absolute path"},
      {{"record.txt"}, "record.txt:2: writes into out/batch.jsonl, which belongs to the batch"},
      {{"summary.txt"}, "out/summary.json, which belongs"},
      {{"table.txt"}, "out/summary.tsv, which belongs"},
      {{"empty.txt"}, "no job in it"},
      {{"empty"}, "no part"},
      {{"quote.txt"}, "quote.txt:1: a ' is not closed"},
      {{"same.txt"}, "same.txt:1 and same.txt:2: both write into"},
      {{"nested.txt"}, "nested.txt:1 and nested.txt:3"},
      {{"own.txt"}, "belongs to the batch"},
      {{"gone.txt"}, "gone.txt: no such file or directory; name a list"},
      {{}, "no jobs"},
      {{"part10.stl", "--memory", "x"}, "--memory"},
      {{"part10.stl", "--jobs", "-1"}, "--jobs"},
      {{"part10.stl", "--time-limit", "0"}, "--time-limit"},
      {{"part10.stl", "--resume", "--overwrite"}, "exclude each other"},
      {{"part10.stl", "--with", " "}, "--with"}};
  for (auto [words, said] : cases) {
    words.insert(words.end(), {"-o", "out"});
    const Outcome outcome = lamina(batch_of(words, {}));
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(said), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(directory_ / "out"));
  }
  EXPECT_FALSE(fs::exists(directory_ / "keep"));
  EXPECT_EQ(lamina(batch_of({"part10.stl"}, {})).code, 2);
}

TEST_F(JobsInBatch, NamesOfPartsAreNoReasonToWriteOverTheBatchAndAbsoluteOutputsLieAnywhere) {
  write_boxes(1);
  fs::copy_file(directory_ / "part10.stl", directory_ / "summary.json.stl");
  write_text(directory_ / "list.txt", "jet part10.stl --bed 60x60 --dpi 100 -o " + directory_ / "keep" + "\n");
  const Outcome outcome = lamina(batch_of({"summary.json.stl", "list.txt", "-o", "./out"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(summary("out")["jobs"][0]["output"], "summary.json-2");
  EXPECT_EQ(lamina({"verify", "keep", "--quiet"}).code, 0);
}

TEST_F(JobsInBatch, QuietItStillSaysWhichJobsFail) {
  write_boxes(1);
  write_text(directory_ / "list.txt", "jet part10.stl --bed 60x60 --dpi 100 -o a\njet nowhere.stl -o b\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out", "--quiet"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
  EXPECT_EQ(outcome.err.find("lamina: list.txt:2: "), 0u) << outcome.err;
  EXPECT_NE(outcome.err.find("nowhere.stl"), std::string::npos) << outcome.err;
}

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
  const auto stamps = [&](const std::string& place) {
    Stamps found;
    for (const std::string& file : files_below(directory_ / place)) {
      struct stat status {};
      EXPECT_EQ(::stat((directory_ / (place + "/" + file)).c_str(), &status), 0) << file;
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

  // Each kill comes once so many layers are there, at whatever the batch happens to do then: the last one long before it
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
  explicit SmallDisk(const std::string& place) : place_(place) {
    fs::create_directories(place_);
    mounted_ = ::mount("tmpfs", place_.c_str(), "tmpfs", 0, "size=192k") == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(place_.c_str(), MNT_DETACH);
  }
  bool mounted() const { return mounted_; }
  bool grow() const { return ::mount("tmpfs", place_.c_str(), "tmpfs", MS_REMOUNT, "size=64m") == 0; }

 private:
  std::string place_;
  bool mounted_;
};

TEST_F(JobsInBatch, AFullDiskIsOneLineTheRestIsUnharmedAndWithRoomItGoesOn) {
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
  EXPECT_NE(reason.find("No space left on device); free some space; finished layers are kept, go on with --resume"),
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
  // Asking twice does not make it the batch's own.
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

TEST_F(JobsInBatch, TimeLimitStopsOneJobAndFailFastAll) {
  write_boxes(2);
  write_text(directory_ / "list.txt",
             "jet part10.stl --bed 60x60 --dpi 100 -o a\n"
             "jet part10.stl --bed 400x400 --dpi 1200 --layer 0.0002 --format tiff-none -o long\n"
             "jet part11.stl --bed 60x60 --dpi 100 -o b\n");
  const Outcome outcome = lamina({"batch", "list.txt", "-o", "out", "--jobs", "1", "--time-limit", "0.5"});
  EXPECT_EQ(outcome.code, 3);  // of a job that failed: nobody interrupted the batch
  EXPECT_EQ(outcomes("out"), (Words{"done", "time limit", "done"}));
  EXPECT_EQ(summary("out")["jobs"][1]["reason"], "took longer than its time limit of 0.5 s");
  EXPECT_EQ(summary("out")["jobs"][1]["code"], 3);
  EXPECT_NE(outcome.err.find("3: 2 done, 1 failed\n"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("time limit list.txt:2: took longer than its time limit of 0.5 s\n"), std::string::npos)
      << outcome.err;
  write_text(directory_ / "fast.txt", "jet part10.stl --bed 60x60 --dpi 100 -o a\njet nowhere.stl -o c\njet part11.stl -o d\n");
  EXPECT_EQ(lamina({"batch", "fast.txt", "-o", "fast", "--jobs", "1", "--fail-fast", "--quiet"}).code, 3);
  EXPECT_EQ(outcomes("fast"), (Words{"done", "failed", "not run"}));
  EXPECT_FALSE(fs::exists(directory_ / "fast/d"));
}

TEST_F(JobsInBatch, JobsBeginOnlyWhenTheirNeedFitsAndALargerOneRunsAlone) {
  write_boxes(6);
  std::string list;
  for (int i = 10; i < 16; ++i) {
    list += "jet part" + std::to_string(i) + ".stl --bed 60x60 --dpi 300 --memory " + (i == 13 ? "500M" : "40M") + "\n";
  }
  write_text(directory_ / "list.txt", list);
  ASSERT_EQ(lamina({"batch", "list.txt", "-o", "out", "--jobs", "6", "--memory", "120M", "--quiet"}).code, 0);
  const Json json = summary("out");
  EXPECT_LE(json["most_at_work"], 2);
  EXPECT_GT(json["most_need_bytes"], 500ull << 20);
  EXPECT_LT(json["most_need_bytes"], 530ull << 20);  // alone
  EXPECT_LT(json["peak_resident_bytes"], 120ull << 20);
}

TEST_F(JobsInBatch, InterruptedItSaysHowToGoOn) {
  write_boxes(1);
  const Words words = batch_of({"part10.stl", "-o", "out", "--resume"},
                               {"--with", "jet --bed 400x400 --dpi 1200 --layer 0.0002 --format tiff-none"});
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
