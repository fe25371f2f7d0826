// pipeline/pores/predict_flow.h: the pores of a window of voxels, Darcy's k1 and Forchheimer's k2.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/pores/porosity.h"
#include "stages/pores/surface.h"
#include "stages/segment/permeability.h"
#include "stages/stokes/flow.h"

namespace lamina::pipeline {

/// Darcy's permeability along an axis, and across it where the fluid is led aside.
struct Darcy {
  std::array<double, 3> k_m2{};      // mean velocity x viscosity / force, along x, y, z
  std::array<double, 3> error_m2{};  // what voxels of this size may be wrong by, from voxels twice as large
  double tortuosity = 0;             // mean speed / mean velocity
  std::uint32_t steps = 0;
  double residual = 0;   // relative, of the equations
  bool resolved = true;  // voxels twice as large say about the same; else nothing is extrapolated, the error is the value
};

/// Voxels of the flow are cut so many times finer along each edge, to locate walls in them.
inline constexpr std::uint32_t kFiner = 3;

/// One window in three ways.
struct PoreRasters {
  VoxelView voxels;              // of the report and the throats
  VoxelView fine;                // kFiner times as many along each axis
  VoxelView coarse;              // kFiner times as many as voxels about twice as large
  std::uint32_t finer = kFiner;  // 1: images, whose pixels are all that is known; voxels and fine are the same then
};

/// What k1 of segmented lines may be, m2: the voxels' error, and the acceleration of the head, which nothing in a plan shows.
/// The profile's 500 mm/s2 was chosen with measured k1 in view, and public sources of the same printer say 400 and 1000. With
/// these two k1 of six printed plans is 0.80 to 0.87 and 1.21 to 1.43 times that with 500 (bench/pores.md, table of other
/// numbers): the range takes the outer factors, as evaluating each plan again would triple the cost.
struct K1Range {
  double low = 0, high = 0;
};
inline K1Range k1_range(double k1, double error) { return {0.80 * std::max(k1 - error, 0.0), 1.43 * (k1 + error)}; }

struct PoreReport {
  std::uint64_t voxels = 0, empty = 0;
  pores::Porosity porosity;
  double surface_per_mm = 0;                 // mm2 in a mm3
  std::array<double, 3> throat_mm{};         // the largest ball that passes along x, y, z; 0: none does
  std::array<std::optional<Darcy>, 3> flow;  // along the axes that were requested
  std::optional<stokes::Section> section;    // along z, or where nothing leads through along it, of the largest k1
};

struct FlowRequest {
  std::array<bool, 3> axes{true, true, true};
  double tolerance = 1e-4;
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
  bool inertia = false;  // counts its memory too
  bool section = false;  // velocities of a picture, over the mean of the whole cross-section
};

/// Along axes that do not repeat, walls close the sides of the window, and fluid stands before its ends.
/// advance  receives the progress, 0 .. 1; false stops
/// errors  kUsage: it does not fit the memory, with the voxels that do; kInput: no void; kInterrupted
/// cost    of stokes::solve() for each axis and window
Result<PoreReport> analyse_pores(const PoreRasters& rasters, const FlowRequest& request,
                                 const std::function<bool(double)>& advance);

inline constexpr std::uint32_t kFlowLevels = 8;  // of the solver

/// dp / L = (mu / k1) v + (rho / k2) v^2, fitted to computed flows as to measured ones: all points, none weighted.
struct Forchheimer {
  segment::Permeability fit;  // errors are of the fit, and of voxels twice as large where these say more
  std::vector<segment::FlowPoint> points;
  double reynolds_per_velocity = 0;  // of pores, s/m: void velocity x 4 void / surface x density / viscosity
  double weak_reynolds = 0;          // up to which the excess goes with the cube of the velocity
  bool settled = true;               // else the last point found no steady flow and is left out
};

/// Six flows along z, in equal steps up to a pore Reynolds number.
/// report  of the window, with its flow along z
/// errors  kInput: nothing to fit, as in straight pores; kInterrupted
/// cost    some hundred creeping flows through the window
Result<Forchheimer> analyse_inertia(const PoreRasters& rasters, const PoreReport& report,
                                    const std::function<bool(double)>& advance);

}  // namespace lamina::pipeline
