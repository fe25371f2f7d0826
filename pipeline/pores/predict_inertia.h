// pipeline/pores/predict_inertia.h: Forchheimer's k2 of a window of voxels.
#pragma once

#include <functional>
#include <vector>

#include "pipeline/pores/predict_flow.h"
#include "stages/segment/permeability.h"

namespace lamina::pipeline {

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
