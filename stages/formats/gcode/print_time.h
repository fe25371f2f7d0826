// stages/formats/gcode/print_time.h: the seconds that a firmware needs for moves, by its look-ahead. Marlin's planner.cpp
// (classic jerk, also RepRapFirmware's and Repetier's rule): the speed of each axis, E among them, changes by at most the
// corner speed at once. Klipper's toolhead.py: corners by its square corner velocity, a halt before and after each move of the
// filament alone, whose acceleration follows from nozzle and filament, and cruise speeds by minimum_cruise_ratio. What a
// profile does not contain has the firmware's default. tests/segment/print_time compares it with simulations of both planners.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "stages/data/extruder.h"

namespace lamina::formats::gcode {

/// Seconds over a length from standstill to standstill.
double rest_to_rest(double length_mm, double speed_mm_s, double acceleration_mm_s2);

/// Takes moves in the order of the file.
class PrintTime {
 public:
  /// x, y, z and E, mm.
  using Delta = std::array<double, 4>;

  explicit PrintTime(const Extruder& machine);

  /// speed_mm_s  of the head, or of the filament if it moves alone; > 0
  /// cost        O(1); moves wait in an array until kMoves of them are planned
  void move(const Delta& delta_mm, double speed_mm_s);
  /// The acceleration of moves that follow, mm/s2, and the speed that corners change at once, mm/s; both > 0.
  void set_limits(double acceleration_mm_s2, double corner_mm_s) { acceleration_ = acceleration_mm_s2, corner_ = corner_mm_s; }
  double corner_mm_s() const { return corner_; }
  /// Halts the machine. returns  seconds of all moves so far
  double halt();

 private:
  /// Squares of speeds are named 2, mm2/s2.
  struct PlannedMove {
    double length, acceleration;
    double speed2, entry2;     // maxima
    double rise, gentle_rise;  // of the squared speed over the length; the gentle one is that of minimum_cruise_ratio
    double gentle_entry2;
  };
  /// Speeds of the move before, per mm of path.
  struct Direction {
    Delta unit;
    double speed;
  };
  static constexpr std::size_t kMoves = 256;  // firmwares plan fewer: Marlin 16

  double jerk_entry(const Direction& direction) const;
  double corner_entry2(const PlannedMove& move, const Direction& direction) const;
  void add(PlannedMove move);
  void finish_moves(std::size_t count);

  bool klipper_;
  double acceleration_, filament_acceleration_, corner_, gentle_;
  bool moving_ = false;  // `before_` is the move before, without a halt since
  Direction before_{};
  std::size_t size_ = 0;
  std::array<PlannedMove, kMoves> moves_;
  double cruise2_ = HUGE_VAL;  // of the last finished move since a halt
  double seconds_ = 0;
};

}  // namespace lamina::formats::gcode
