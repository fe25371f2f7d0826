// stages/stokes/flow.h: creeping flow of a fluid through the void of a box of voxels, the permeability that follows, and
// sections.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/stokes/cells.h"
#include "stages/stokes/operator.h"

namespace lamina::stokes {

struct FlowOptions {
  double tolerance = 1e-4;  // of the residual, relative; the permeability is as exact or better
  std::uint32_t max_steps = 20'000;
  std::function<bool(std::uint32_t step, double residual)> progress;  // false ends the work; may be empty
};

/// Flow that a uniform force along one axis drives, for viscosity 1, force 1 and the shortest edge of a voxel as the unit.
struct Flow {
  std::array<double, 3> permeability{};  // mean velocity over the whole box along x, y, z; in squared units
  double tortuosity = 0;                 // mean speed / mean velocity along the force, in the void; 0 without flow
  double residual = 0;                   // relative, as computed anew from the result
  std::uint32_t steps = 0;
};

/// Solves Stokes' equations by minimal residuals, started from `field` (field_of(), or that of a similar problem), which
/// becomes the velocities and pressures. The same digits for any number of threads. axis     of the force returns  a Flow whose
/// residual is above the tolerance if the steps did not suffice, or single precision: it ends at about
///          1e-7 of the square of a pore's width in voxels, which the mean velocity hardly feels
/// force    of each face, with a source of mass in the fourth lane, in place of the uniform one; null: none
/// errors   kInterrupted: by progress
/// source   C. C. Paige, M. A. Saunders, "Solution of sparse indefinite systems of linear equations", SIAM J. Numer. Anal. 12
///          (1975), preconditioned as in H. C. Elman, D. J. Silvester, A. J. Wathen (2014), algorithm 4.1
/// cost     some hundred steps, more for windows of many pores; 140 bytes a cell with the grid
Result<Flow> solve(const Grid& grid, int axis, const FlowOptions& options, Field& field, const Field* force = nullptr);

/// The bytes a cell that a step reads and writes at least: neighbours and walls of the cell for the product, 32 and 48 of
/// fields; then six fields read and three written; then walls, one field read and one written.
inline constexpr double kBytesMoved = 264;

/// What a permeability may be off by at least, relative: differences of second order as in a slit of the same hydraulic radius,
/// half of (voxel / radius)^2; and walls that are known to a tenth of a fine voxel at best, of a slit of that radius and of
/// balls that have as much surface as the solid. surface  of walls, in squared voxels a voxel of the box factor   of
/// make_grid()
double error_floor(double porosity, double surface, std::uint32_t factor);

/// The bytes that solve() and its grid take.
std::uint64_t bytes_of_flow(std::uint64_t cells);

// --- velocities on two planes through a flow, as pictures have them.

/// Planes through the place where a fluid is fastest along the axis that drives it, in voxels of the flow. Velocities are those
/// in the middles of voxels, 0 in the solid.
struct Section {
  std::array<std::uint32_t, 3> size{}, fastest{};  // of the box without the fluid before its ends; the place in it
  Plane across;                                    // velocity along the axis
  Plane along;  // speed; of the two planes along the axis the one that the narrower side of the pore lies in
};

/// How cells of a flow lie in the box that is drawn.
struct CellPositions {
  Buffer<std::array<std::uint32_t, 3>> at;  // of each cell; cell_positions(), turned back into the box where it was turned
  std::array<std::uint32_t, 3> size;        // of the box, voxels of the flow
  int axis;                                 // of the box, along which the force is
  int lane;                                 // of the field, with velocities along it
};

/// mean  velocity that becomes 1
/// ends  voxels of fluid before both ends of the axis: they are left out, and places count from behind the first ones
/// cost  O(cells)
Section section_of(CellPositions positions, const Cells& cells, const Field& field, double mean, std::uint32_t ends);

}  // namespace lamina::stokes
