// stages/replay/bytes.h: readers shared by the binary dialects: numbers, the head's way, records of head maintenance.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <utility>

#include "stages/replay/printing.h"

namespace lamina::replay {

/// An unsigned number at an address, the lowest byte first.
template <class T>
T little_endian(const char* bytes) {
  static_assert(std::endian::native == std::endian::little);
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

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
  /// The next bytes, which are not taken; fewer at the end.
  std::string_view ahead(std::size_t count) const { return left_.substr(0, count); }
  std::uint32_t word() { return static_cast<std::uint32_t>(number(4)); }
  /// Of nm as i32.
  double mm() { return static_cast<std::int32_t>(word()) / 1e6; }
  bool done() const { return left_.empty(); }
  void fault(std::string_view what) { printing_.fault(fmt::format("byte {}: {}", all_ - left_.size(), what)); }

 private:
  std::string_view left_;
  std::size_t all_;
  Printing& printing_;
};

/// The head's way in dialects that hold vectors alone, where the machine moves by its profile: from where it waits to the
/// ramp before a sweep's first step that fires, over its last one to the ramp behind, to the next sweep, and back.
class Passes {
 public:
  explicit Passes(Printing& printing) : printing_(printing), along_(printing.profile().mounting.scan_axis == ScanAxis::kX) {
    const AxisPositions position = printing.axis_positions();
    at_along_ = along_ ? position.x_mm : position.y_mm;
    at_across_ = along_ ? position.y_mm : position.x_mm;
  }

  /// Ends the sweep before. across_mm  of the carriage
  void begin(double across_mm, bool backward) {
    stop();
    across_ = across_mm;
    backward_ = backward;
    left_out_ = printing_.leaves_out_sweep();
    if (left_out_ || !printing_.turns_anew()) return;
    turned_ = backward != anew_;
    anew_ = !anew_;
  }
  /// The head goes to a position off the bed. works_mm_s  how fast over its wiper; 0: as it travels
  void visit(double x_mm, double y_mm, double works_mm_s) {
    stop();
    const double along = along_ ? x_mm : y_mm, across = along_ ? y_mm : x_mm;
    const double speed = works_mm_s > 0 ? works_mm_s : printing_.profile().motion.travel_speed_mm_s;
    go(along, across, speed);
    printing_.head_is_at(x_mm, y_mm, works_mm_s);
  }
  /// A step that fires, in the order of the movement. drops  the most of a nozzle there
  void at(std::int64_t step, std::uint32_t drops = 1) {
    if (left_out_) return;
    if (!any_) first_ = step, max_ = 1;
    last_ = step;
    max_ = std::max(max_, drops);
    any_ = true;
  }
  /// Ends the sweep before; the head stays where that ends.
  void stop() {
    if (!any_) return;
    const auto& motion = printing_.profile().motion;
    if (turned_) std::swap(first_, last_);
    const bool grows = (printing_.position_of(1) > printing_.position_of(0)) != (backward_ != turned_);
    const double ramp = grows ? motion.ramp_mm : -motion.ramp_mm;
    const double from = printing_.position_of(static_cast<double>(first_)) - ramp;
    const double to = printing_.position_of(static_cast<double>(last_)) + ramp;
    go(from, across_, motion.travel_speed_mm_s);
    printing_.head_is_at(along_ ? from : across_, along_ ? across_ : from, 0);
    printing_.head_moves(to - from, motion.scan_speed_mm_s, true, max_);
    at_along_ = to;
    any_ = false;
    printing_.head_is_at(along_ ? to : across_, along_ ? across_ : to, 0);
  }
  /// Where the carriage stands.
  double x_mm() const { return along_ ? at_along_ : at_across_; }
  double y_mm() const { return along_ ? at_across_ : at_along_; }
  /// Ends the last sweep; the head goes back.
  void end() {
    const AxisPositions position = printing_.axis_positions();
    visit(position.x_mm, position.y_mm, 0);
  }

 private:
  void go(double along, double across, double mm_s) {
    printing_.head_moves(std::hypot(along - at_along_, across - at_across_), mm_s, false);
    at_along_ = along;
    at_across_ = across;
  }

  Printing& printing_;
  bool along_;  // the scan is along x
  double at_along_ = 0, at_across_ = 0, across_ = 0;
  std::int64_t first_ = 0, last_ = 0;
  std::uint32_t max_ = 1;  // drops of a nozzle at a step
  bool backward_ = false, any_ = false;
  bool left_out_ = false, turned_ = false, anew_ = false;  // anew_: the next one of those that are left runs back
};

/// Carries out the records of care that follow, as many as there are. The dialect is that of the profile.
void take_maintenance_records(ByteReader& reader, Printing& printing, Passes& passes);

}  // namespace lamina::replay
