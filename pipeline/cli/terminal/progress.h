// pipeline/cli/terminal/progress.h: the progress display of the layers for stderr.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "stages/support/text/terminal.h"

namespace lamina::pipeline {

/// A bar on a terminal, redrawn at most every 100 ms; elsewhere a plain line per tenth of the layers, at most once a
/// second, and every 5 s. Returns the text to write, mostly empty, and writes nothing itself.
/// cost  one clock reading per call
class Progress {
 public:
  enum class Style { kSilent, kBar, kLines };
  explicit Progress(Style style) : style_(style) {}

  /// Starts a phase without numbers: "loading parts".
  std::string begin(std::string_view what);
  /// Sets the number of finished layers, or of another unit; the first call sets the number kept from before.
  std::string report(std::uint32_t done, std::uint32_t total, std::string_view unit = "layers");
  /// The text that erases the bar before another line.
  std::string clear() { return line_.clear(); }

  /// The text after the bar and in the lines: "1200/4800 layers, 312.5 layers/s, 11.5 s left".
  /// before  finished layers from before, not counted in the seconds
  static std::string rate(std::uint32_t done, std::uint32_t total, std::uint32_t before, double seconds,
                          std::string_view unit = "layers");

 private:
  using Clock = std::chrono::steady_clock;
  std::string draw(std::string_view what, double share);

  Style style_;
  bool counting_ = false;
  StatusLine line_;
  std::uint32_t before_ = 0;
  std::uint32_t tenths_reported_ = 0;
  Clock::time_point started_ = Clock::now(), reports_ = started_;
};

}  // namespace lamina::pipeline
