// tests/pipeline/run/test_timing.cpp: where the time of a run goes, and the least that it could be.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "pipeline/cli/console.h"
#include "pipeline/report/timing.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

const std::atomic<bool> never{false};

/// So much to write that its end is never reached, in files of 1 MB.
formats::Floor endless_floor() {
  formats::Floor floor;
  floor.bytes_written = std::uint64_t{1} << 50;
  floor.files = std::uint64_t{1} << 30;
  return floor;
}

/// Waits until a temporary file of `target` is there. returns  false if `give_up` comes first
template <class GiveUp>
bool wait_for_temporary(const test::Directory& folder, const std::string& target, const GiveUp& give_up) {
  for (;;) {
    for (const std::string& name : test::files_below(folder.path())) {
      if (named_by_temporary(name) == target) return true;
    }
    if (give_up()) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

/// Measures the endless limit in a process of its own, which a signal ends. returns  the signal
int ended_while_measuring(const test::Directory& folder, int signal) {
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CORE, &none);
    for (const int one : {SIGHUP, SIGINT, SIGQUIT}) std::signal(one, SIG_DFL);  // not as the tests were started
    handle_signals();
    formats::Floor floor = endless_floor();
    static_cast<void>(formats::measure_floor({}, folder / "part.gcode", never, floor));
    ::_exit(1);
  }
  int result = 0;
  const bool measures = wait_for_temporary(folder, "part.gcode", [&] { return ::waitpid(child, &result, WNOHANG) == child; });
  EXPECT_TRUE(measures) << result;
  if (!measures) return 0;
  ::kill(child, signal);
  ::waitpid(child, &result, 0);
  return WIFSIGNALED(result) ? WTERMSIG(result) : 0;
}

TEST(Timing, ARunReportsEachStepAndWhatTheLimitReadsAndWrites) {
  const test::Directory folder;
  const std::string part = test::corpus_file("dental_crown.stl");
  const std::vector<std::string> job = {"jet",     part,  "--bed",  "30x30",   "--dpi", "600",
                                        "--layer", "0.2", "--json", "--quiet", "-o"};
  const auto summary_of = [&](std::vector<std::string> more) {
    more.insert(more.begin(), job.begin(), job.end());
    const test::Outcome outcome = test::run_lamina(more, folder.path());
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out, nullptr, false);
  };
  const nlohmann::json timed = summary_of({"timed", "--timing"});
  const nlohmann::json &timing = timed["timing"], &limit = timing["limit"];
  double steps = 0;
  for (const char* step : {"raster", "dose", "encode", "store", "record"}) {
    EXPECT_GT(timing["nodes"][step]["processor_seconds"], 0) << step;
    EXPECT_GT(timing["nodes"][step]["busy_seconds"], 0) << step;
    steps += timing["nodes"][step]["processor_seconds"].get<double>();
  }
  EXPECT_LE(steps, timing["phases"]["layers"]["processor_seconds"]) << "steps are parts of the phase";
  EXPECT_EQ(limit["read_bytes"], std::filesystem::file_size(part));
  std::uint64_t bytes = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder.path() / "timed" / "layers")) bytes += file.file_size();
  EXPECT_EQ(limit["write_bytes"], bytes);
  EXPECT_EQ(limit["write_files"], timed["layers_planned"]);
  EXPECT_FALSE(summary_of({"untimed"}).contains("timing"));
}

// A limit counts the crossings of pixels; nothing is rastered here.
TEST(Timing, ContoursAndPathsHaveNoLimit) {
  const test::Directory folder;
  const std::string part = test::corpus_file("dental_crown.stl");
  for (const std::vector<std::string>& job : {std::vector<std::string>{"slice", part, "--layer", "1", "-o", "sliced"},
                                              {"extrude", part, "--layer", "0.3", "-o", "part.gcode"}}) {
    std::vector<std::string> timed = job;
    timed.insert(timed.end(), {"--timing", "--json"});
    const test::Outcome outcome = test::run_lamina(timed, folder.path());
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const nlohmann::json timing = nlohmann::json::parse(outcome.out)["timing"];
    EXPECT_TRUE(timing.contains("nodes"));
    EXPECT_FALSE(timing.contains("limit")) << job.front();
    EXPECT_EQ(outcome.err.find("limit"), std::string::npos) << outcome.err;
  }
}

// Amdahl: a share s alone and the rest on n threads take s + (1 - s) / n of the time of one.
TEST(Timing, TheShareOfOneThreadFollowsFromWallAndProcessor) {
  for (const double share : {0.0, 0.25, 1.0}) {
    const double work = 8, wall = work * (share + (1 - share) / 4);
    // Of the wall time, that of the serial part.
    EXPECT_NEAR(serial_share({wall, work}, 4), work * share / wall, 1e-12) << share;
  }
  EXPECT_EQ(serial_share({2, 1}, 1), 0);
  EXPECT_EQ(serial_share({0, 0}, 4), 0);
  EXPECT_EQ(serial_share({1, 5}, 4), 0) << "clocks that differ a little";
}

TEST(Timing, TheLimitReadsThePartsAndLeavesNothing) {
  const test::Directory folder;
  test::write_text(folder / "part.stl", std::string(1000, 'x'));
  formats::Floor floor;
  floor.bytes_written = 1001;
  floor.files = 3;
  floor.crossings = 100;
  const Status status = formats::measure_floor({folder / "part.stl"}, folder / "out", never, floor);
  ASSERT_TRUE(status.ok()) << status.error().message;
  EXPECT_EQ(floor.bytes_read, 1000u);
  EXPECT_GT(floor.write, 0);
  EXPECT_EQ(test::files_below(folder.path()).size(), 1u);
}

TEST(Timing, ASignalWhileTheLimitIsMeasuredLeavesNothing) {
  const test::Directory folder;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    EXPECT_EQ(ended_while_measuring(folder, signal), signal);
    EXPECT_EQ(test::tree_text(folder.path()), "") << signal;
  }
}

TEST(Timing, WhatAKilledRunLeavesGoesWithTheNextThatWritesTheFile) {
  const test::Directory folder;
  ASSERT_EQ(ended_while_measuring(folder, SIGKILL), SIGKILL);
  ASSERT_TRUE(write_file(folder / "part.gcode", "whole").ok());
  const std::vector<std::string> files = test::files_below(folder.path());
  EXPECT_EQ(files, std::vector<std::string>{"part.gcode"});
}

TEST(Timing, AMeasurementThatIsCancelledEndsAndLeavesNothing) {
  const test::Directory folder;
  std::atomic<bool> cancel{false};
  Status status;
  std::thread measures([&] {
    formats::Floor floor = endless_floor();
    status = formats::measure_floor({}, folder / "part.gcode", cancel, floor);
  });
  wait_for_temporary(folder, "part.gcode", [] { return false; });
  cancel = true;
  measures.join();
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kInterrupted);
  EXPECT_EQ(test::tree_text(folder.path()), "");
}

// A timer interrupts every call that may be interrupted; its handler does not have calls started again.
TEST(Timing, InterruptedCallsGoOn) {
  const test::Directory folder;
  test::write_text(folder / "part.stl", std::string(1 << 20, 'x'));
  struct sigaction action {
  }, before{};
  action.sa_handler = [](int) {};
  sigaction(SIGALRM, &action, &before);
  const itimerval often{{0, 100}, {0, 100}}, off{};
  ::setitimer(ITIMER_REAL, &often, nullptr);
  formats::Floor floor;
  floor.bytes_written = 50 << 20;
  floor.files = 5;
  const Status status = formats::measure_floor({folder / "part.stl"}, folder / "out", never, floor);
  ::setitimer(ITIMER_REAL, &off, nullptr);
  sigaction(SIGALRM, &before, nullptr);
  ASSERT_TRUE(status.ok()) << status.error().message;
  EXPECT_EQ(floor.bytes_read, std::uint64_t{1} << 20);
}

TEST(Timing, ALimitThatWasNotMeasuredHasNoNumbers) {
  Timing timing;
  timing.phases = {{"layers", {2, 3}}};
  timing.floor.emplace().bytes_written = 10;
  const test::Directory folder;
  timing.not_measured = formats::measure_floor({folder / "missing.stl"}, folder / "out", never, *timing.floor).error().message;
  EXPECT_NE(timing.not_measured.find("missing.stl: "), std::string::npos);
  const Json limit = timing_json(timing)["limit"];
  EXPECT_EQ(limit.size(), 1u) << json_text(limit);
  EXPECT_EQ(limit["not_measured"], timing.not_measured);
  bool reported = false;
  for (const auto& [label, line] : timing_lines(timing)) {
    reported |= line.find("not measured: ") != std::string::npos;
    EXPECT_EQ(line.find("times the limit"), std::string::npos) << line;
  }
  EXPECT_TRUE(reported);
}

}  // namespace
}  // namespace lamina::pipeline
