// stages/program/care/care_clock.h: when a head is due to be fired off the bed and wiped, by layers and by seconds.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/machine.h"

namespace lamina::write {

/// Of a limit in seconds: speeds are written in whole mm a minute, and firmware rounds as well.
inline constexpr double kOfCareLimit = 0.97;

/// From rest to rest at a speed as it is spelt. way_mm  at least 0
double move_seconds(const Machine& machine, double way_mm, double speed_mm_s);

/// A shot off the bed at the head's highest frequency.
double shot_seconds(const Machine& machine);

/// The clock of a layer, which begins with it, so that a layer's care depends on that layer alone.
class CareClock {
 public:
  using Place = std::array<double, 2>;  // of the carriage, x and y in mm

  /// What is due, in this order; a shot follows each wipe where the profile has shots, since a wiper leaves binder and grains
  /// at the nozzles.
  struct Due {
    bool wipe = false, shot = false;
  };

  /// machine outlives this object. shot_s  how long a shot takes
  CareClock(const Machine& machine, double shot_s) : machine_(machine), shot_s_(shot_s) {}

  /// Before the first sweep. at  where the head stands
  Due begin_layer(std::uint32_t layer, Place at);
  /// Before a sweep: what would be overdue at its end. The sweep is then made.
  /// from, to  of the sweep. sweep_s  how long it takes without the way to it
  Due before_sweep(Place from, Place to, double sweep_s);
  Due before_sweep(Place from, Place to);

 private:
  Due serve(bool wipe, bool shot);
  double seconds(Place from, Place to, double speed_mm_s) const;

  const Machine& machine_;
  double shot_s_;
  Place at_{};
  double since_shot_ = 0, since_wipe_ = 0;  // seconds
};

}  // namespace lamina::write
