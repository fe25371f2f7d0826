// stages/stokes/inertia.h: steady flow with inertia through the void of a box of voxels.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "stages/data/status.h"
#include "stages/stokes/cells.h"
#include "stages/stokes/operator.h"

namespace lamina::stokes {

struct InertiaOptions {
  double tolerance = 1e-4;        // of the velocities: what a creeping flow would change, relative
  std::uint32_t max_rounds = 40;  // where it does not settle, the flow may have no steady state
  std::function<bool(std::uint32_t round, double change)> progress;  // false ends the work; may be empty
};

/// Flow that a uniform force along one axis drives, in units that make viscosity, force and the shortest edge of a voxel 1.
struct InertialFlow {
  std::array<double, 3> permeability{};  // apparent: mean velocity over the whole box along x, y, z; in squared units
  double change = 0;                     // that creeping flow answers to what the equations lack; root of the mean square
  bool settled = false;                  // the change is within the tolerance
  std::uint32_t rounds = 0, steps = 0;   // Newton's; of minimal residuals for creeping flows
};

/// Solves the steady Navier-Stokes equations, inertia (u . grad) u - div grad u + grad p = 1 along the axis, div u = 0, from
/// `field` on, which becomes velocities and pressures: zero, or that of a smaller force. By Newton's method; its equations by
/// minimal residuals (GMRES), with creeping flow as the preconditioner. The same digits for any number of threads.
///
/// inertia  density x force per volume x (shortest edge)^3 / viscosity^2; 0 is creeping flow
/// returns  a flow that is not settled if the rounds did not suffice, or no step leads on
/// errors   kInterrupted: by progress
/// source   Y. Saad, M. H. Schultz, "GMRES: a generalized minimal residual algorithm for solving nonsymmetric linear systems",
///          SIAM J. Sci. Stat. Comput. 7 (1986); R. S. Dembo, S. C. Eisenstat, T. Steihaug, "Inexact Newton methods", SIAM J.
///          Numer. Anal. 19 (1982); H. C. Elman, D. J. Silvester, A. J. Wathen (2014), 8 and 9
/// cost     3 to 8 rounds of 5 to 17 creeping flows of little exactness, more with more inertia; see bytes_of_inertia()
Result<InertialFlow> solve_with_inertia(const Grid& grid, int axis, double inertia, const InertiaOptions& options,
                                        Field& field);

/// The bytes that solve_with_inertia() and its grid take.
std::uint64_t bytes_of_inertia(std::uint64_t cells);

// --- how velocity grows with force, where inertia bends it.

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
Result<std::vector<SweepPoint>> sweep(const Grid& grid, int axis, double maximum, std::uint32_t count,
                                      const InertiaOptions& options);

/// The velocity up to which inertia takes more than velocity^2.5: weak inertia, where the excess force goes with the cube.
/// source  C. C. Mei, J.-L. Auriault, "The effect of weak inertia on flow through a porous medium", J. Fluid Mech. 222 (1991)
double weak_up_to(const std::vector<SweepPoint>& points);

}  // namespace lamina::stokes
