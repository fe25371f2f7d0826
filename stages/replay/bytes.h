// stages/replay/bytes.h: readers shared by the binary dialects of print programs.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <string_view>

#include "stages/replay/printing.h"

namespace lamina::replay {

/// Reads little-endian numbers from bytes; 0 at a fault.
class ByteReader {
 public:
  ByteReader(std::string_view bytes, Printing& printing) : left_(bytes), all_(bytes.size()), printing_(printing) {}

  /// Empty at a fault.
  std::string_view take(std::size_t count) {
    if (count > left_.size()) {
      fault(fmt::format("ends where {} bytes should follow", count));
      return {};
    }
    const std::string_view taken = left_.substr(0, count);
    left_.remove_prefix(count);
    return taken;
  }
  std::uint64_t number(std::size_t bytes) {
    std::uint64_t value = 0;
    const std::string_view taken = take(bytes);
    for (std::size_t i = 0; i < taken.size(); ++i) value |= std::uint64_t{static_cast<std::uint8_t>(taken[i])} << (8 * i);
    return value;
  }
  std::uint32_t word() { return static_cast<std::uint32_t>(number(4)); }
  bool done() const { return left_.empty(); }
  void fault(std::string_view what) { printing_.fault(fmt::format("byte {}: {}", all_ - left_.size(), what)); }

 private:
  std::string_view left_;
  std::size_t all_;
  Printing& printing_;
};

/// The scan length derived from the data: from the first to the last step of a sweep.
class ScanLength {
 public:
  explicit ScanLength(Printing& printing) : printing_(printing) {}
  void begin() { end(), any_ = false; }
  void at(std::int64_t step) {
    if (!any_) first_ = step;
    last_ = step;
    any_ = true;
  }
  void end() {
    if (!any_) return;
    const double mm =
        std::abs(printing_.position_of(static_cast<double>(last_)) - printing_.position_of(static_cast<double>(first_)));
    printing_.head_moves(mm + 2 * printing_.profile().motion.ramp_mm, printing_.profile().motion.scan_speed_mm_s, true);
    any_ = false;
  }

 private:
  Printing& printing_;
  std::int64_t first_ = 0, last_ = 0;
  bool any_ = false;
};

}  // namespace lamina::replay
