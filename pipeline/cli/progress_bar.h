// pipeline/cli/progress_bar.h: how far a job is, for a person who waits for it.
#pragma once

#include <chrono>
#include <string>

#include "pipeline/plan/progress.h"

namespace lamina::pipeline {

/// A bar on a terminal, redrawn at most every 100 ms; elsewhere a plain line every tenth of the layers, but not more
/// often than once a second, and every 5 s. All goes to stderr.
/// cost  a clock is read for every event; nothing is written in between
class Progress {
 public:
  enum class Style { kSilent, kBar, kLines };
  explicit Progress(Style style) : style_(style) {}
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void operator()(const ProgressEvent& event);
  /// Takes the bar away, for a line that follows.
  void clear();

  /// What stands behind the bar and in the lines: "1200/4800 layers, 312.5 layers/s, 11.5 s left".
  static std::string text(const ProgressEvent& event, std::uint32_t done_before, double seconds);

 private:
  using Clock = std::chrono::steady_clock;
  void draw(const std::string& what, double share);

  Style style_;
  bool drawn_ = false, counting_ = false;
  std::uint32_t done_before_ = 0;  // layers that a resumed job kept
  std::uint32_t tenths_told_ = 0;
  Clock::time_point started_ = Clock::now(), told_ = started_;
};

}  // namespace lamina::pipeline
