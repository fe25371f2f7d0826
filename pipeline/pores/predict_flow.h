// pipeline/pores/predict_flow.h: the pores of a window of voxels and what a fluid sees of them.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/pores/porosity.h"
#include "stages/pores/surface.h"
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

/// The box with fluid before both ends of an axis, which repeats then.
VoxelStack with_fluid_at_ends(const VoxelView& box, int axis);

inline constexpr std::uint32_t kFlowLevels = 8;  // of the solver

}  // namespace lamina::pipeline
