#include "pipeline/batch/queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <functional>
#include <memory>
#include <thread>

#include "pipeline/batch/summary.h"
#include "stages/load/part_store.h"
#include "stages/support/text/json_value.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using RunOne = std::function<BatchResult(const CallSettings&, const ProgressCallback&, const std::atomic<bool>&)>;

/// A job whose words are its number.
BatchJob job_of(std::uint32_t number, std::uint64_t need_bytes, const std::string& output) {
  BatchJob job;
  job.number = number;
  job.entry.name = "job " + std::to_string(number);
  job.output = output;
  job.need_bytes = need_bytes;
  job.id.low = number;
  return job;
}

/// runs  one a job
Result<BatchSummary> run_jobs(const test::Directory& directory, const std::vector<BatchJob>& jobs,
                              const std::vector<RunOne>& runs, const BatchOptions& options, const BatchWatcher& watcher = {},
                              const std::atomic<bool>& interrupt = false) {
  Result<BatchRecord> record = BatchRecord::open(directory.path().string(), options.resume, options.overwrite);
  if (!record) return record.error();
  const RunJob run = [runs](const BatchJob& job, const CallSettings& settings, const ProgressCallback& progress,
                            const std::atomic<bool>& cancel) { return runs[job.number - 1](settings, progress, cancel); };
  return run_batch(std::make_shared<const std::vector<BatchJob>>(jobs), std::move(*record), options, run, watcher, interrupt);
}

TEST(BatchQueue, SharedPartsLeaveTheirMemoryToJobs) {
  const test::Directory directory;
  test::write_text(directory / "part", "a part");
  std::this_thread::sleep_for(std::chrono::milliseconds(130));  // a file that was written just now is not stored
  BatchOptions options;
  options.directory = directory.path().string();
  options.memory_bytes = 100;
  options.loaded = std::make_shared<load::PartStore>(loaded_share(100, 0));
  std::vector<std::uint64_t> stored;
  const RunOne fill = [&](const CallSettings&, const ProgressCallback&, const std::atomic<bool>&) {
    stored.push_back(options.loaded->bytes());
    for (const char* key : {"a", "b", "c", "d"}) {
      options.loaded->add(key, directory / "part", *file_stamp(directory / "part"), std::make_shared<const int>(1), 10);
    }
    stored.push_back(options.loaded->bytes());
    BatchResult result;
    result.outcome = BatchOutcome::kDone;
    return result;
  };
  std::vector<BatchJob> jobs;
  for (const std::uint32_t number : {1, 2, 3, 4}) jobs.push_back(job_of(number, std::vector{10, 85, 200, 10}[number - 1], ""));
  ASSERT_TRUE(run_jobs(directory, jobs, {fill, fill, fill, fill}, options).ok());
  EXPECT_EQ(stored, (std::vector<std::uint64_t>{0, 20, 10, 10, 0, 0, 0, 20})) << "a quarter, and what jobs leave";
}

TEST(BatchQueue, JobsShareThreadsAndMemoryAndEachIsReportedOnce) {
  const test::Directory directory;
  std::atomic<std::uint64_t> need{0}, highest{0};
  std::vector<BatchJob> jobs;
  std::vector<RunOne> runs;
  for (std::uint32_t number = 1; number <= 24; ++number) {
    const std::uint64_t bytes = 10 + number % 5 * 10;
    jobs.push_back(job_of(number, bytes, directory / ("out" + std::to_string(number))));
    runs.push_back(
        [&, number, bytes](const CallSettings& settings, const ProgressCallback& progress, const std::atomic<bool>&) {
          const std::uint64_t now = need += bytes;
          for (std::uint64_t before = highest; before < now && !highest.compare_exchange_weak(before, now);) {
          }
          for (std::uint32_t layer = 1; layer <= 5; ++layer) {
            progress({ProgressEvent::Stage::kLayers, layer, 5});
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
          }
          std::ofstream(settings.output) << number;
          need -= bytes;
          BatchResult result;
          result.code = number % 6 == 0 ? 3 : 0;
          return result;
        });
  }
  BatchOptions options;
  options.jobs = 4;
  options.memory_bytes = 100;
  std::vector<std::uint32_t> reported;
  BatchWatcher watcher;
  watcher.progress = [](const BatchState& state) { EXPECT_LE(state.running.size(), 4u); };
  watcher.ended = [&](const BatchJob& job, const BatchResult& result, const BatchState&) {
    reported.push_back(job.number);
    EXPECT_EQ(result.outcome, job.number % 6 == 0 ? BatchOutcome::kFailed : BatchOutcome::kDone) << job.number;
  };
  const Result<BatchSummary> summary = run_jobs(directory, jobs, runs, options, watcher);
  ASSERT_TRUE(summary) << summary.error().message;
  std::sort(reported.begin(), reported.end());
  ASSERT_EQ(reported.size(), 24u);
  for (std::uint32_t number = 1; number <= 24; ++number) EXPECT_EQ(reported[number - 1], number);
  EXPECT_LE(summary->max_need_bytes, 100u);
  EXPECT_LE(highest.load(), 100u);
  EXPECT_LE(summary->max_running, 4u);

  // The second run continues the record: what is done and unchanged is kept, what failed runs again.
  options.resume = true;
  const Result<BatchSummary> again = run_jobs(directory, jobs, runs, options);
  ASSERT_TRUE(again) << again.error().message;
  for (std::uint32_t i = 0; i < 24; ++i) {
    EXPECT_EQ(again->results[i].outcome, (i + 1) % 6 == 0 ? BatchOutcome::kFailed : BatchOutcome::kKept) << i + 1;
  }
}

TEST(BatchQueue, AnInterruptStopsRunningJobsAndStartsNoOther) {
  const test::Directory directory;
  std::atomic<bool> interrupt{false};
  std::atomic<std::uint32_t> begun{0};
  std::vector<BatchJob> jobs;
  std::vector<RunOne> runs;
  for (std::uint32_t number = 1; number <= 8; ++number) {
    jobs.push_back(job_of(number, 1, {}));
    runs.push_back([&](const CallSettings&, const ProgressCallback&, const std::atomic<bool>& cancel) {
      if (++begun == 2) interrupt = true;
      while (!cancel) std::this_thread::yield();
      BatchResult result;
      result.code = static_cast<int>(Fault::kInterrupted);
      return result;
    });
  }
  BatchOptions options;
  options.jobs = 2;
  const Result<BatchSummary> summary = run_jobs(directory, jobs, runs, options, {}, interrupt);
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_TRUE(summary->interrupted);
  EXPECT_FALSE(summary->abandoned);
  EXPECT_EQ(begun, 2u);
  for (std::uint32_t i = 0; i < 8; ++i) {
    EXPECT_EQ(summary->results[i].outcome, i < 2 ? BatchOutcome::kStopped : BatchOutcome::kNotRun) << i + 1;
  }
}

// 100,000 jobs fit into 100 MiB: what a job is stays a few hundred bytes, and its result is in the record alone.
TEST(BatchQueue, ResultsStayInTheRecordAndAreReadFromItForTheSummary) {
  const test::Directory directory;
  std::vector<BatchJob> jobs;
  std::vector<RunOne> runs;
  for (std::uint32_t number = 1; number <= 3; ++number) {
    jobs.push_back(job_of(number, 1, {}));
    jobs.back().entry.words = std::vector<std::string>{"info", "", "part " + std::to_string(number)};
    runs.push_back([number](const CallSettings&, const ProgressCallback&, const std::atomic<bool>&) {
      BatchResult result;
      result.value = {{"number", number}, {"warnings", Json::array({"first", "second"})}, {"text", "two\nlines]"}};
      return result;
    });
  }
  EXPECT_EQ(jobs[0].entry.words.unpacked(), (std::vector<std::string>{"info", "", "part 1"}));
  EXPECT_LE(sizeof(BatchJob) + sizeof(BatchResult), 500u);
  BatchOptions options;
  options.directory = directory.path().string();
  std::string first_time;
  for (const bool resume : {false, true}) {
    options.resume = resume;
    const Result<BatchSummary> summary = run_jobs(directory, jobs, runs, options);
    ASSERT_TRUE(summary) << summary.error().message;
    for (const BatchResult& result : summary->results) {
      EXPECT_EQ(result.outcome, resume ? BatchOutcome::kKept : BatchOutcome::kDone);
      EXPECT_TRUE(result.value.is_null());
      EXPECT_GT(result.line.bytes, 0u);
      EXPECT_EQ(result.warnings, 2u);
      EXPECT_EQ(result.first_warning, "first");
    }
    for (const int indent : {-1, 2}) {
      std::string text;
      const auto append = [&](std::string_view piece) { return text += piece, Status(); };
      ASSERT_TRUE(write_batch_json(jobs, *summary, options, 1, indent, append));
      const Json json = parse_json(text);
      EXPECT_EQ(text, json_line(json, indent));
      ASSERT_EQ(json["jobs"].size(), 3u);
      EXPECT_EQ(json["warnings"].get<int>(), 6);
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(json["jobs"][i]["result"]["number"].get<std::size_t>(), i + 1);
        EXPECT_EQ(json["jobs"][i]["result"]["text"].text(), "two\nlines]");
      }
    }
  }
}

}  // namespace
}  // namespace lamina::pipeline
