// stages/stokes/sweep.h: how velocity grows with force, where inertia bends it.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/status.h"
#include "stages/stokes/inertia.h"

namespace lamina::stokes {

/// One flow, in units that make density, viscosity and the shortest edge of a voxel 1: forces per volume count in
/// viscosity^2 / (density edge^3), velocities in viscosity / (density edge).
struct SweepPoint {
  double force = 0, velocity = 0;  // mean velocity over the whole box along the force
  double excess = 0;               // force / what creeping flow of the same velocity takes, less 1
  bool settled = false;
};

/// Flows at about `count` equal steps of velocity up to `most`, each started from the one before.
/// most     velocity, above 0
/// returns  fewer points where a flow does not settle: it is the last one then
/// errors   kInterrupted: by options.progress
/// cost     of a creeping flow and `count` times solve_with_inertia()
Result<std::vector<SweepPoint>> sweep(const Grid& grid, int axis, double most, std::uint32_t count,
                                      const InertiaOptions& options);

/// The velocity up to which inertia takes more than velocity^2.5: weak inertia, where the excess force goes with the cube.
/// source  C. C. Mei, J.-L. Auriault, "The effect of weak inertia on flow through a porous medium", J. Fluid Mech. 222 (1991)
double weak_up_to(const std::vector<SweepPoint>& points);

}  // namespace lamina::stokes
