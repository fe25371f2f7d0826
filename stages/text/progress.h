// stages/text/progress.h: how far the layers are, for a person who waits for them at stderr.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "stages/text/terminal.h"

namespace lamina {

/// A bar on a terminal, redrawn at most every 100 ms; elsewhere a plain line every tenth of the layers, but not more
/// often than once a second, and every 5 s. What is to be written is given as text, mostly none; nothing is written here.
/// cost  a clock is read for every call
class Progress {
 public:
  enum class Style { kSilent, kBar, kLines };
  explicit Progress(Style style) : style_(style) {}

  /// Something begins that tells no numbers: "loading parts".
  std::string begin(std::string_view what);
  /// So many layers are done; the first call tells how many were there before.
  std::string tell(std::uint32_t done, std::uint32_t total);
  /// What takes the bar away, for a line that follows.
  std::string clear() { return line_.clear(); }

  /// What stands behind the bar and in the lines: "1200/4800 layers, 312.5 layers/s, 11.5 s left".
  /// before  layers of those done that took none of the seconds
  static std::string rate(std::uint32_t done, std::uint32_t total, std::uint32_t before, double seconds);

 private:
  using Clock = std::chrono::steady_clock;
  std::string draw(std::string_view what, double share);

  Style style_;
  bool counting_ = false;
  StatusLine line_;
  std::uint32_t before_ = 0;
  std::uint32_t tenths_told_ = 0;
  Clock::time_point started_ = Clock::now(), told_ = started_;
};

}  // namespace lamina
