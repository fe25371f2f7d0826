// tests/commands/batch/test_shares.cpp: a batch in shares is the undivided batch, however its processes start and end.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <set>
#include <sstream>
#include <thread>

#include "stages/support/hash/hash.h"
#include "stages/support/io/journal.h"
#include "tests/commands/batch/batch.h"

namespace lamina::test {
namespace {

class BatchInShares : public JobsInBatch {
 protected:
  /// Twelve jobs of three parts, two of them failing, with names that are equal but for a number.
  void write_list() {
    write_boxes(3);
    std::string list;
    for (int i = 0; i < 10; ++i) {
      list += "jet part" + std::to_string(10 + i % 3) + ".stl --bed 60x60 --dpi 100 --layer 0." + std::to_string(2 + i) + "\n";
    }
    write_text(directory_ / "jobs.txt", list + "jet nowhere.stl -o gone\ninfo part10.stl nowhere.stl\n");
  }

  Outcome share(const std::string& shard, Words more = {}, const std::string& list = "jobs.txt") {
    more.insert(more.begin(), {"batch", list, "-o", "out", "--shard", shard, "--quiet"});
    return lamina(more);
  }

  /// A summary without what depends on time and memory, and without names of directories.
  std::string results(const std::string& batch) {
    Json json = summary(batch);
    erase_usage(json);
    json.erase("directory");
    json.erase("max_running");
    return json.dump(1);
  }

  static void erase_usage(Json& json) {
    for (auto member = json.begin(); json.is_object() && member != json.end();) {
      const std::string& name = member.key();
      const bool usage = name == "seconds" || name.ends_with("_seconds") || name.ends_with("_per_second") ||
                         name.ends_with("_bytes") || name == "max_layers_in_flight";
      member = usage ? json.erase(member) : std::next(member);
    }
    for (Json& value : json) {
      if (value.is_structured()) erase_usage(value);
      if (value.is_object() && value.contains("dry_run")) value.erase("output");
    }
  }

  std::string table(const std::string& batch) {
    std::istringstream lines(read_text(directory_ / (batch + "/summary.tsv")));
    std::string text;
    for (std::string line; std::getline(lines, line);) {
      std::istringstream cells(line);
      std::string cell;
      for (int column = 0; std::getline(cells, cell, '\t'); ++column) text += column == 3 ? "" : cell + "\t";
      text += "\n";
    }
    return text;
  }

  std::vector<std::string> files_of_batch(const std::string& batch) {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(directory_ / batch)) {
      if (!entry.is_directory()) names.push_back(entry.path().filename());
    }
    std::ranges::sort(names);
    return names;
  }
};

const Words kFilesOfUndivided = {"batch.jsonl", "summary.json", "summary.tsv"};

TEST_F(BatchInShares, MergedTheyAreTheUndividedBatch) {
  write_list();
  ASSERT_EQ(lamina({"batch", "jobs.txt", "-o", "whole", "--jobs", "1", "--quiet"}).code, 3);
  std::set<std::string> codes;
  // In any order; also more shares than jobs.
  for (const int shares : {3, 13}) {
    for (int i = shares; i >= 1; --i) {
      const Outcome outcome = share(std::to_string(i) + "/" + std::to_string(shares), {"--jobs", "1"});
      codes.insert(std::to_string(outcome.code));
      if (i == 1 || shares > 3) continue;
      EXPECT_EQ(lamina({"batch", "out", "--status"}).code, 5) << i;
    }
    EXPECT_EQ(codes, (std::set<std::string>{"0", "3"}));
    EXPECT_EQ(lamina({"batch", "out", "--status"}).code, 3);
    const Outcome merged = lamina({"merge", "out"});
    EXPECT_EQ(merged.code, 3) << merged.err;
    EXPECT_NE(merged.err.find("12 jobs of " + std::to_string(shares) + " shares joined"), std::string::npos) << merged.err;
    EXPECT_EQ(files_of_batch("out"), kFilesOfUndivided);
    EXPECT_EQ(results("out"), results("whole"));
    EXPECT_EQ(table("out"), table("whole"));
    EXPECT_EQ(tree("out"), tree("whole"));
    const auto lines = [&](const std::string& batch) {
      const std::string text = read_text(directory_ / (batch + "/batch.jsonl"));
      return std::ranges::count(text, '\n');
    };
    EXPECT_EQ(lines("out"), lines("whole"));
    // It is an undivided batch from here on. What an interrupted merge left goes.
    write_text(directory_ / "out/batch-2-of-9.jsonl", "");
    EXPECT_EQ(lamina({"merge", "out", "-o", "out"}).code, 3);
    EXPECT_EQ(files_of_batch("out"), kFilesOfUndivided);
    EXPECT_EQ(lamina({"batch", "out", "--status"}).code, 3);
    ASSERT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--resume", "--quiet"}).code, 3);
    EXPECT_EQ(std::ranges::count(outcomes("out"), "kept"), 10);
    fs::remove_all(directory_ / "out");
    codes.clear();
  }
}

TEST_F(BatchInShares, EachJobIsInOneShareThatEveryProcessWouldPlan) {
  write_list();
  share("2/3");
  const auto jobs_of_plan = [&] {
    const std::string text = read_text(directory_ / "out/shares.tsv");
    return text.substr(text.find("\nshares\t"), text.rfind("end\t") - text.find("\nshares\t"));  // without the generation
  };
  const std::string plan = jobs_of_plan();
  fs::rename(directory_ / "out", directory_ / "first");
  share("3/3");
  EXPECT_EQ(jobs_of_plan(), plan);
  std::set<int> jobs;
  for (int i = 1; i <= 3; ++i) {
    share(std::to_string(i) + "/3", {"--resume"});
    const std::string name = "out/summary-" + std::to_string(i) + "-of-3.json";
    const Json json = Json::parse(read_text(directory_ / name));
    EXPECT_EQ(json["shard"], std::to_string(i) + "/3");
    for (const Json& job : json["jobs"]) EXPECT_TRUE(jobs.insert(job["job"].get<int>()).second) << job["job"];
  }
  EXPECT_EQ(jobs.size(), 12u);
}

TEST_F(BatchInShares, ProcessesThatStartTogetherFollowOnePlan) {
  write_list();
  const auto start_all = [&] {
    std::vector<std::thread> processes;
    std::vector<Outcome> ended(6);
    for (int i = 0; i < 6; ++i)
      processes.emplace_back(
          [&, i] { ended[static_cast<std::size_t>(i)] = share(std::to_string(i + 1) + "/6", {"--overwrite"}); });
    for (std::thread& process : processes) process.join();
    for (const Outcome& outcome : ended) EXPECT_TRUE(outcome.code == 0 || outcome.code == 3) << outcome.err;
  };
  start_all();
  // Again with a plan to be replaced.
  const std::string plan = read_text(directory_ / "out/shares.tsv");
  write_text(directory_ / "jobs.txt", read_text(directory_ / "jobs.txt") + "info part11.stl\n");
  start_all();
  EXPECT_NE(read_text(directory_ / "out/shares.tsv"), plan);
  EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, 3);
  EXPECT_EQ(files_of_batch("out"), kFilesOfUndivided);
}

TEST_F(BatchInShares, AShareReplacesNoPlanOfARunningOneAndNoRecordOfAnEqualPlan) {
  write_list();
  for (const char* shard : {"1/2", "2/2"}) share(shard);
  const auto missing = [&](std::size_t number) {
    return Json::parse(lamina({"batch", "out", "--status", "--json"}).out)["shares"][number - 1]["missing"].get<int>();
  };
  const std::string plan = read_text(directory_ / "out/shares.tsv");
  EXPECT_NE(share("1/2", {"--overwrite"}).code, 2);
  EXPECT_EQ(read_text(directory_ / "out/shares.tsv"), plan);
  EXPECT_EQ(missing(2), 0);
  // Equal jobs of a replaced plan do not count, also after a plan of the first list.
  fs::copy(directory_ / "jobs.txt", directory_ / "first.txt");
  write_text(directory_ / "jobs.txt", read_text(directory_ / "jobs.txt") + "info part11.stl\n");
  const int held = ::open((directory_ / "out/batch-2-of-2.jsonl").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(::flock(held, LOCK_EX | LOCK_NB), 0);
  const Outcome refused = share("1/2", {"--overwrite"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_EQ(refused.error_lines(), 1u) << refused.err;
  EXPECT_NE(refused.err.find("out/batch-2-of-2.jsonl: is running in another process"), std::string::npos) << refused.err;
  EXPECT_EQ(read_text(directory_ / "out/shares.tsv"), plan);
  ::close(held);
  for (const char* list : {"jobs.txt", "first.txt"}) {
    EXPECT_NE(share("1/2", {"--overwrite"}, list).code, 2);
    EXPECT_GT(missing(2), 0) << list;
  }
  EXPECT_NE(lamina({"merge", "out"}).err.find("share 2 of 2: never started"), std::string::npos);
  share("2/2", {"--resume"}, "first.txt");
  EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, 3);
}

TEST_F(BatchInShares, WrongSharesAreRefusedInOneLine) {
  write_list();
  const auto refused = [&](const Outcome& outcome, const std::string& reported, int code = 2) {
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(reported), std::string::npos) << outcome.err;
  };
  for (const char* shard : {"0/4", "5/4", "3/0", "1", "a/b"}) refused(share(shard), "--shard");
  EXPECT_FALSE(fs::exists(directory_ / "out"));
  share("1/4");
  refused(share("1/4"), "belongs to an earlier batch; continue it with --resume");
  refused(share("1/3"), "out/shares.tsv: divides the batch into 4 shares, not 3");
  refused(share("2/4", {"--with", "slice"}), "the shares have --with");
  refused(lamina({"batch", "jobs.txt", "-o", "out", "--quiet"}), "out/shares.tsv: belongs to a batch in shares");
  refused(lamina({"batch", "jobs.txt", "-o", "out", "--quiet", "--resume"}), "out/shares.tsv: belongs to a batch in shares");
  write_text(directory_ / "other.txt", read_text(directory_ / "jobs.txt") + "info part11.stl\n");
  refused(share("2/4", {}, "other.txt"), "other.txt:13: job 13 is not in out/shares.tsv");
  std::string plan = read_text(directory_ / "out/shares.tsv");
  write_text(directory_ / "out/shares.tsv", plan.substr(0, plan.size() / 2));
  refused(share("2/4"), "out/shares.tsv: is damaged", 5);
  refused(lamina({"batch", "out", "--status"}), "out/shares.tsv: is damaged", 5);
  refused(lamina({"merge", "out"}), "out/shares.tsv: is damaged", 5);
  write_text(directory_ / "out/shares.tsv", plan);
  // Replaced, it is a batch without shares, which is no directory for shares either.
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--quiet", "--overwrite"}).code, 3);
  EXPECT_EQ(files_of_batch("out"), kFilesOfUndivided);
  refused(share("2/4"), "out/batch.jsonl: belongs to a batch without shares");
  refused(share("2/4", {"--resume"}), "out/batch.jsonl: belongs to a batch without shares");
  EXPECT_NE(share("2/4", {"--overwrite"}).code, 2);
  EXPECT_EQ(files_of_batch("out"), (Words{"batch-2-of-4.jsonl", "shares.tsv", "summary-2-of-4.json", "summary-2-of-4.tsv"}));
  // A job may not write to the files of any share.
  write_text(directory_ / "own.txt", "jet part10.stl -o batch-7-of-9.jsonl\n");
  refused(lamina({"batch", "own.txt", "-o", "new"}), "new/batch-7-of-9.jsonl, which belongs to the batch");
  refused(lamina({"batch", "part10.stl", "--status"}), "part10.stl: no directory of a batch");
  refused(lamina({"batch", "out", "--status", "--resume"}), "--resume");
  refused(lamina({"merge", "out", "-o", "elsewhere"}), "-o");
  refused(lamina({"merge", "out", "out"}), "merge it by itself");
}

TEST_F(BatchInShares, ARunningShareIsLeftAloneAndReported) {
  write_list();
  for (const char* shard : {"1/3", "2/3", "3/3"}) share(shard);
  const int held = ::open((directory_ / "out/batch-2-of-3.jsonl").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_GE(held, 0);
  ASSERT_EQ(::flock(held, LOCK_EX | LOCK_NB), 0);
  const Outcome second = share("2/3", {"--resume"});
  EXPECT_EQ(second.code, 4);
  EXPECT_NE(second.err.find("out/batch-2-of-3.jsonl: this share is running right now in another process"), std::string::npos)
      << second.err;
  const Outcome status = lamina({"batch", "out", "--status"});
  EXPECT_EQ(status.code, 5);
  EXPECT_NE(status.out.find("share 2 of 3: "), std::string::npos);
  EXPECT_NE(status.out.find(", running\n"), std::string::npos) << status.out;
  const Outcome merged = lamina({"merge", "out"});
  EXPECT_EQ(merged.code, 5);
  EXPECT_NE(merged.err.find("share 2 of 3: running"), std::string::npos) << merged.err;
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--overwrite", "--quiet"}).code, 4);
  EXPECT_TRUE(fs::exists(directory_ / "out/shares.tsv"));
  ::close(held);
  EXPECT_EQ(lamina({"batch", "out", "--status"}).code, 3);
}

TEST_F(BatchInShares, AShareThatStartsAsItsPlanIsMergedIsRefused) {
  write_list();
  for (const char* shard : {"1/2", "2/2"}) share(shard);
  const std::string lock = directory_ / "out/shares.tsv.lamina-aaaaaaaaaaaaa.part",
                    record = directory_ / "out/batch-2-of-2.jsonl";
  write_text(lock, "");
  const int merging = ::open(lock.c_str(), O_RDWR | O_CLOEXEC);  // as lamina merge does
  ASSERT_EQ(::flock(merging, LOCK_EX | LOCK_NB), 0);
  std::thread second([&] { lamina({"merge", "out", "--quiet"}); });
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_FALSE(fs::exists(directory_ / "out/batch.jsonl"));  // it waits for the first one
  Outcome started;
  std::thread process([&] { started = share("2/2", {"--overwrite"}); });
  for (int tries = 0; tries < 1000 && !is_journal_held(record); ++tries)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  fs::remove(directory_ / "out/shares.tsv");
  fs::remove(lock);
  ::close(merging);
  process.join();
  second.join();
  EXPECT_EQ(started.code, 4);
  EXPECT_EQ(started.error_lines(), 1u) << started.err;
  EXPECT_NE(started.err.find("were merged or planned again"), std::string::npos) << started.err;
  EXPECT_GT(fs::file_size(record), 0u);
}

/// The lock of a plan, as a process that plans or merges shares has it.
class PlanHeld {
 public:
  explicit PlanHeld(const fs::path& directory) : name_(directory / "shares.tsv.lamina-aaaaaaaaaaaaa.part") {
    fs::create_directories(directory);
    write_text(name_, "");
    file_ = ::open(name_.c_str(), O_RDWR | O_CLOEXEC);
    EXPECT_EQ(::flock(file_, LOCK_EX | LOCK_NB), 0);
  }
  PlanHeld(const PlanHeld&) = delete;
  PlanHeld& operator=(const PlanHeld&) = delete;
  ~PlanHeld() {
    fs::remove(name_);
    ::close(file_);
  }

 private:
  std::string name_;
  int file_ = -1;
};

TEST_F(BatchInShares, PlannedAndRunWhileABatchWithoutSharesPreparesTheyStay) {
  write_list();
  for (const char* shard : {"1/2", "2/2"}) share(shard);
  fs::rename(directory_ / "out", directory_ / "ready");
  Outcome undivided;
  std::optional<PlanHeld> held(directory_ / "out");
  std::thread process([&] { undivided = lamina({"batch", "jobs.txt", "-o", "out", "--quiet"}); });
  std::this_thread::sleep_for(std::chrono::milliseconds(700));  // it has found no plan and waits for the lock
  for (const auto& entry : fs::directory_iterator(directory_ / "ready"))
    fs::rename(entry.path(), directory_ / "out" / entry.path().filename());
  held.reset();
  process.join();
  EXPECT_EQ(undivided.code, 2) << undivided.err;
  EXPECT_NE(undivided.err.find("out/shares.tsv: belongs to a batch in shares"), std::string::npos) << undivided.err;
  EXPECT_FALSE(fs::exists(directory_ / "out/batch.jsonl"));
  EXPECT_EQ(lamina({"batch", "out", "--status"}).code, 3);
}

TEST_F(BatchInShares, AShareThatStartsAsAMergeEndsDividesNothingAgain) {
  write_list();
  ASSERT_EQ(lamina({"batch", "jobs.txt", "-o", "whole", "--quiet"}).code, 3);
  Outcome started;
  std::optional<PlanHeld> held(directory_ / "out");
  std::thread process([&] { started = share("2/2", {"--resume"}); });
  std::this_thread::sleep_for(std::chrono::milliseconds(700));  // it has found no batch and waits for the lock
  fs::copy(directory_ / "whole/batch.jsonl", directory_ / "out/batch.jsonl");
  held.reset();
  process.join();
  EXPECT_EQ(started.code, 2) << started.err;
  EXPECT_NE(started.err.find("out/batch.jsonl: belongs to a batch without shares"), std::string::npos) << started.err;
  EXPECT_EQ(files_of_batch("out"), Words{"batch.jsonl"});
}

TEST_F(BatchInShares, OfAPlanWithOverwriteTheyReplaceOutputsAndContinueTheirOwn) {
  write_boxes(2);
  const std::string options = " --bed 60x60 --dpi 100 --layer 0.";
  const auto write_jobs = [&](const std::string& layer, const std::string& first, const std::string& second) {
    const std::string more = ".stl" + options + layer + " -o ";
    write_text(directory_ / "jobs.txt", "jet part1" + first + more + "a\njet part1" + second + more + "b\nextrude part1" +
                                            first + ".stl --layer 0." + layer + " -o c.gcode\n");
  };
  const auto run = [&](const std::string& batch, const Words& more) {
    Words words = {"batch", "jobs.txt", "-o", batch, "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    return lamina(words);
  };
  write_jobs("4", "0", "1");
  ASSERT_EQ(run("out", {}).code + run("old", {}).code, 0);
  write_jobs("2", "1", "0");
  ASSERT_EQ(run("fresh", {}).code, 0);
  EXPECT_EQ(run("out", {"--plan-shares", "2", "--overwrite"}).code, 0);
  for (const char* shard : {"1/2", "2/2"}) {
    const Outcome outcome = share(shard, {"--resume"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
  }
  const auto expect_fresh = [&] {
    EXPECT_EQ(tree("out"), tree("fresh"));
    EXPECT_EQ(read_text(directory_ / "out/c.gcode"), read_text(directory_ / "fresh/c.gcode"));
  };
  expect_fresh();
  // As a kill leaves it that came once all jobs had begun, before the first one replaced what was there.
  std::vector<fs::path> records;
  for (const char* name : {"batch-1-of-2.jsonl", "batch-2-of-2.jsonl"}) {
    std::istringstream record(read_text(directory_ / ("out/" + std::string(name))));
    std::string begun;
    for (std::string line; std::getline(record, line);) begun += line.find("\"ended\"") == std::string::npos ? line + "\n" : "";
    write_text(directory_ / ("out/" + std::string(name)), begun);
  }
  for (const char* name : {"a", "b", "c.gcode", "c.gcode.json"}) {
    fs::remove_all(directory_.path() / "out" / name);
    fs::copy(directory_.path() / "old" / name, directory_.path() / "out" / name, fs::copy_options::recursive);
  }
  for (const char* shard : {"1/2", "2/2"}) EXPECT_EQ(share(shard, {"--resume"}).code, 0);
  expect_fresh();
  // What a share has done it keeps.
  for (const char* shard : {"1/2", "2/2"}) EXPECT_EQ(share(shard, {"--resume"}).code, 0);
  EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, 0);
  EXPECT_EQ(run("out", {"--resume"}).code, 0);
  EXPECT_EQ(outcomes("out"), Words(3, "kept"));
  // Shares of a plan without --overwrite leave what is there.
  fs::remove(directory_ / "old/batch.jsonl");
  EXPECT_EQ(run("old", {"--plan-shares", "1"}).code, 0);
  EXPECT_EQ(run("old", {"--shard", "1/1", "--resume"}).code, 2);
}

TEST_F(BatchInShares, ARepairedJobFileDoesNotBlockThemAndCountsOnce) {
  write_boxes(2);
  ASSERT_EQ(lamina({"jet", "part10.stl", "--bed", "60x60", "--dpi", "100", "--layer", "0.5", "-o", "out/d", "--save-job",
                    "good.toml", "--dry-run"})
                .code,
            0);
  write_text(directory_ / "j.toml", "no job");
  write_text(directory_ / "jobs.txt",
             "jet part10.stl --bed 60x60 --dpi 100 --layer 0.5 -o a\njet --job j.toml\ninfo part10.stl\ninfo part10.stl\n");
  EXPECT_EQ(share("1/2").code + share("2/2").code, 2);
  EXPECT_EQ(lamina({"batch", "out", "--status"}).code, 2);
  fs::copy_file(directory_ / "good.toml", directory_ / "j.toml", fs::copy_options::overwrite_existing);
  for (const char* shard : {"1/2", "2/2"}) {
    const Outcome outcome = share(shard, {"--resume"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
  }
  const Json status = Json::parse(lamina({"batch", "out", "--status", "--json"}).out);
  EXPECT_EQ(status["code"], 0);
  EXPECT_EQ(status["done"], 4);
  EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, 0);
  EXPECT_EQ(outcomes("out").size(), 4u);
  EXPECT_EQ(lamina({"batch", "out", "--status"}).out, "4 of 4 jobs done\n");
}

TEST_F(BatchInShares, MergeNamesWhatIsMissingAndWritesNothing) {
  write_list();
  share("1/3");
  share("2/3");
  const std::string record = read_text(directory_ / "out/batch-2-of-3.jsonl");
  // As a kill leaves it: the last line is torn.
  write_text(directory_ / "out/batch-2-of-3.jsonl", std::string_view(record).substr(0, record.size() - 9));
  const std::vector<std::string> before = files_of_batch("out");
  const Outcome merged = lamina({"merge", "out"});
  EXPECT_EQ(merged.code, 5);
  EXPECT_NE(merged.err.find("out: share 2 of 3: not finished: 1 jobs missing"), std::string::npos) << merged.err;
  EXPECT_NE(merged.err.find("out: share 3 of 3: never started"), std::string::npos) << merged.err;
  EXPECT_EQ(files_of_batch("out"), before);
  const Outcome status = lamina({"batch", "out", "--status", "--json"});
  EXPECT_EQ(status.code, 5);
  const Json json = Json::parse(status.out);
  EXPECT_EQ(json["code"], 5);
  EXPECT_EQ(json["jobs_total"], 12);
  EXPECT_EQ(json["shares"][1]["missing"], 1);
  EXPECT_EQ(json["shares"][2]["started"], false);
  EXPECT_EQ(json["done"].get<int>() + json["failed"].get<int>() + json["missing"].get<int>(), 12);
  share("2/3", {"--resume"});
  share("3/3", {"--resume"});
  EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, 3);
}

TEST_F(BatchInShares, NamesThatAreNotUtf8AreMergedVerifiedAndKept) {
  write_boxes(1);
  for (const char* name : {"b\xe9.stl", "b\xe8.stl"}) fs::copy(directory_ / "part10.stl", directory_ / name);
  write_text(directory_ / "jobs.txt",
             "jet b\xe9.stl --bed 60x60 --dpi 100\njet b\xe8.stl --bed 60x60 --dpi 100\ninfo b\xe8.stl\n");
  for (const char* shard : {"1/2", "2/2"}) EXPECT_EQ(share(shard).code, 0);
  const Outcome merged = lamina({"merge", "out"});
  EXPECT_EQ(merged.code, 0) << merged.err;
  EXPECT_EQ(summary("out")["jobs"].size(), 3u);
  EXPECT_EQ(lamina({"verify", "out"}).code, 0);
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--resume", "--quiet"}).code, 0);
  EXPECT_EQ(outcomes("out"), Words(3, "kept"));
}

TEST_F(BatchInShares, RecordsOfAnotherListDoNotCount) {
  write_list();
  for (const char* shard : {"1/2", "2/2"}) share(shard);
  write_boxes(3);
  write_text(directory_ / "new.txt",
             "jet part10.stl --bed 60x60 --dpi 100 --layer 0.7 -o a\njet part11.stl --bed 60x60 --dpi 100 --layer 0.7 -o b\n");
  EXPECT_EQ(share("1/2", {"--overwrite"}, "new.txt").code, 0);
  EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, 5);
  EXPECT_EQ(share("2/2", {"--overwrite"}, "new.txt").code, 0);
  EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, 0);
  EXPECT_EQ(summary("out")["jobs"].size(), 2u);
}

TEST_F(BatchInShares, StatusOfAnUndividedBatchCountsItsJobs) {
  write_list();
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "whole", "--quiet"}).code, 3);
  const Outcome status = lamina({"batch", "whole", "--status"});
  EXPECT_EQ(status.code, 3);
  EXPECT_EQ(status.out, "10 of 12 jobs done, 2 failed\n");
  const std::string record = read_text(directory_ / "whole/batch.jsonl");
  std::istringstream lines(record);
  std::string line, half;
  for (int i = 0; i < 7 && std::getline(lines, line); ++i) half += line + "\n";
  write_text(directory_ / "whole/batch.jsonl", half);
  const Outcome stopped = lamina({"batch", "whole", "--status", "--json"});
  EXPECT_EQ(stopped.code, 5);
  const Json json = Json::parse(stopped.out);
  EXPECT_EQ(json["jobs_total"], 12);
  EXPECT_GT(json["missing"], 6);
  EXPECT_EQ(json["running"], false);
  EXPECT_EQ(lamina({"merge", "whole"}).code, 5);
  // As it starts, and killed then.
  write_text(directory_ / "whole/batch.jsonl", "");
  const auto reported = [&](const std::string& printed, const std::string& missing) {
    const Outcome now = lamina({"batch", "whole", "--status"}), merged = lamina({"merge", "whole"});
    EXPECT_EQ(now.code + merged.code, 10) << now.err << merged.err;
    EXPECT_EQ(now.out, printed);
    EXPECT_EQ(merged.err, "lamina: whole: " + missing + "\n");
  };
  reported("0 of 0 jobs done, never started\n", "no job was started; run the batch again");
  const int held = ::open((directory_ / "whole/batch.jsonl").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(::flock(held, LOCK_EX | LOCK_NB), 0);
  reported("0 of 0 jobs done, running\n", "has just started; wait for it");
  ::close(held);
}

TEST_F(BatchInShares, ForSlurmStandardInputIsRefusedInOneLine) {
  const std::string program = fs::path(LAMINA_TEST_DIR).parent_path() / "scripts/cluster/slurm_batch", err = directory_ / "err";
  const int status = std::system(("LAMINA=false '" + program + "' 2 - -o out 2>'" + err + "'").c_str());
  EXPECT_EQ(WEXITSTATUS(status), 2);
  EXPECT_EQ(read_text(err), "scripts/cluster/slurm_batch: -: the tasks cannot read standard input; write the list to a file\n");
}

TEST_F(BatchInShares, ForSlurmSharesOfAReplacedBatchReplaceItsOutputs) {
  write_boxes(1);
  const auto write_jobs = [&](const std::string& layer) {
    write_text(directory_ / "jobs.txt", "jet part10.stl --bed 60x60 --dpi 100 --layer " + layer + " -o a\n");
  };
  write_jobs("0.5");
  ASSERT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--quiet"}).code, 0);
  write_jobs("0.25");
  // Runs each script at once, an array as its first task.
  write_text(directory_ / "sbatch", "#!/bin/bash\nSLURM_ARRAY_TASK_ID=1 bash >&2 || echo failed >&2\necho 1\n");
  fs::permissions(directory_ / "sbatch", fs::perms::owner_all);
  const std::string program = fs::path(LAMINA_TEST_DIR).parent_path() / "scripts/cluster/slurm_batch", err = directory_ / "err";
  const int status = std::system(("cd '" + directory_.path().string() + "' && PATH=$PWD:$PATH LAMINA='" LAMINA_PROGRAM "' '" +
                                  program + "' 1 jobs.txt -o out --overwrite --quiet >/dev/null 2>'" + err + "'")
                                     .c_str());
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(read_text(err), "out: 1 jobs of 1 shares joined\n");
  EXPECT_EQ(outcomes("out"), Words{"done"});
  EXPECT_EQ(files_of_batch("out"), kFilesOfUndivided);
}

TEST_F(BatchInShares, PlanSharesWritesNoFilesThatJobsName) {
  write_boxes(1);
  write_text(directory_ / "jobs.txt", "jet part10.stl --layer 0.5 --machine jet1000 --quote q.csv --save-job=s.toml -o a\n");
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--plan-shares", "2", "--quiet"}).code, 0);
  EXPECT_FALSE(fs::exists(directory_ / "q.csv"));
  EXPECT_FALSE(fs::exists(directory_ / "s.toml"));
  EXPECT_EQ(share("1/2").code + share("2/2").code, 0);
  EXPECT_TRUE(fs::exists(directory_ / "q.csv"));
  EXPECT_TRUE(fs::exists(directory_ / "s.toml"));
}

TEST_F(BatchInShares, PlanSharesEstimatesByDryRunsAndRunsNoJob) {
  write_boxes(2);
  write_text(
      directory_ / "jobs.txt",
      "jet part10.stl --dpi 100 --layer 0.1 -o a\njet part10.stl --dpi 100 --layer 0.1 --output b\n"
      "jet part10.stl --dpi 10 --layer 0.0001 --format null -o c\nextrude part11.stl --layer 0.2\ninfo part10.stl\njet nowhere.stl -o d\n");
  for (const char* count : {"0", "x"}) EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--plan-shares", count}).code, 2);
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--plan-shares", "2", "--shard", "1/2"}).code, 2);
  EXPECT_FALSE(fs::exists(directory_ / "out"));
  const Outcome planned = lamina({"batch", "jobs.txt", "-o", "out", "--plan-shares", "2", "--json"});
  ASSERT_EQ(planned.code, 0) << planned.err;
  EXPECT_EQ(files_of_batch("out"), Words{"shares.tsv"});
  EXPECT_EQ(files_below(directory_ / "out").size(), 1u);
  const Json json = Json::parse(planned.out);
  EXPECT_EQ(json["plan"]["shares"], 2);
  EXPECT_GE(json["plan"]["max_by_mean"], 1);
  EXPECT_GT(json["plan"]["max_seconds"], 0);
  const std::string plan = read_text(directory_ / "out/shares.tsv");
  EXPECT_NE(plan.find("\nunit\tmicroseconds\n"), std::string::npos) << plan;
  std::vector<double> costs;
  std::istringstream lines(plan.substr(plan.find("job\tshare")));
  for (std::string line; std::getline(lines, line) && !line.starts_with("end");) {
    const Words cells = [&] {
      Words found;
      std::istringstream text(line);
      for (std::string cell; std::getline(text, cell, '\t');) found.push_back(cell);
      return found;
    }();
    if (cells.at(0) != "job") costs.push_back(std::stod(cells.at(2)));
  }
  ASSERT_EQ(costs.size(), 6u);
  EXPECT_GE(costs[0], costs[1]) << "the first of two jobs with equal words loads the part";
  EXPECT_GT(costs[2], costs[1]);
  // The shares follow it; a second plan of the same list changes nothing.
  EXPECT_EQ(share("1/2").code + share("2/2").code, 3);
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--plan-shares", "2", "--quiet"}).code, 0);
  EXPECT_EQ(read_text(directory_ / "out/shares.tsv"), plan);
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--plan-shares", "3", "--quiet"}).code, 2);
  EXPECT_EQ(lamina({"batch", "jobs.txt", "-o", "out", "--plan-shares", "3", "--quiet", "--overwrite"}).code, 0);
  EXPECT_EQ(files_of_batch("out"), (Words{"part11.gcode", "part11.gcode.json", "shares.tsv"}));
}

TEST_F(BatchInShares, VerifyComparesEveryOutputWithTheRecord) {
  write_boxes(2);
  write_text(
      directory_ / "jobs.txt",
      "jet part10.stl --bed 60x60 --dpi 100 --layer 0.5 --format png -o a\njet part11.stl --bed 60x60 --dpi 100 --layer 0.5 -o b\n"
      "extrude part11.stl --layer 0.2 -o c.gcode\njet nowhere.stl -o d\ninfo part10.stl\n");
  const auto faults = [&](const Words& more, const std::string& reported) {
    Words words = {"verify", "out"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = lamina(words);
    EXPECT_EQ(outcome.code, reported.empty() ? 0 : 5) << reported << outcome.err;
    EXPECT_NE(outcome.err.find(reported), std::string::npos) << outcome.err;
    if (!reported.empty()) {
      EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    }
    return outcome.out;
  };
  EXPECT_EQ(share("1/2").code + share("2/2").code, 3);
  EXPECT_NE(faults({}, "").find("out: 5 jobs, "), std::string::npos);
  fs::rename(directory_ / "out/batch-2-of-2.jsonl", directory_ / "kept");
  faults({"--quick"}, "out: share 2 of 2: never started");
  fs::rename(directory_ / "kept", directory_ / "out/batch-2-of-2.jsonl");
  EXPECT_EQ(lamina({"merge", "out", "--quiet"}).code, 3);
  const std::string layer = directory_ / "out/a/layers/000001.png", bytes = read_text(layer);
  std::string other = bytes;
  other[other.size() / 2] ^= 1;
  write_text(layer, other);
  faults({"--quick"}, "out: jobs.txt:1: a: has other contents than recorded");
  // A record that agrees with the files leaves the manifest of the job.
  const std::string record = read_text(directory_ / "out/batch.jsonl");
  const auto digest = digest_tree(directory_ / "out/a");
  ASSERT_TRUE(digest);
  write_text(layer, bytes);
  const auto recorded = digest_tree(directory_ / "out/a");
  ASSERT_TRUE(recorded);
  write_text(layer, other);
  std::string forged = record;
  forged.replace(forged.find(hex(recorded->hash)), 32, hex(digest->hash));
  write_text(directory_ / "out/batch.jsonl", forged);
  faults({"--quick"}, "out: jobs.txt:1: a: layers/000001.png");
  write_text(layer, bytes);
  write_text(directory_ / "out/batch.jsonl", record);
  write_text(directory_ / "out/b/layers/extra", "");
  faults({}, "out: jobs.txt:2: b: has ");
  fs::remove(directory_ / "out/b/layers/extra");
  fs::rename(directory_ / "out/c.gcode", directory_ / "c.gcode");
  faults({}, "out: jobs.txt:3: c.gcode: is missing");
  fs::rename(directory_ / "c.gcode", directory_ / "out/c.gcode");
  EXPECT_EQ(Json::parse(faults({"--json"}, ""))["jobs"], 5);
  EXPECT_EQ(lamina({"verify", "out", "--quote", "x.csv"}).code, 2);
}

}  // namespace
}  // namespace lamina::test
