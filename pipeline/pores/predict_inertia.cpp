#include "pipeline/pores/predict_inertia.h"

#include <algorithm>
#include <cmath>

#include "stages/stokes/canonical.h"
#include "stages/stokes/inertia.h"

namespace lamina::pipeline {
namespace {

constexpr double kMaxReynolds = 40;
constexpr std::uint32_t kPoints = 6;

Result<Forchheimer> sweep_through(const VoxelView& box, double surface_per_mm, const std::function<bool(double)>& advance) {
  const VoxelStack longer = box.periodic[2] ? VoxelStack() : with_fluid_at_ends(box, 2);
  const VoxelView used = box.periodic[2] ? box : longer.view();
  Result<stokes::Canonical> canonical = stokes::Canonical::of(used, 2, false);
  if (!canonical) return canonical.error();
  const Result<stokes::Grid> grid = stokes::make_grid(canonical->view(), kFiner, kFlowLevels);
  if (!grid) return grid.error();
  canonical->forget_voxels();
  const segment::Fluid fluid;
  const double h = grid->cells.unit_m, velocity = fluid.viscosity_pa_s / (fluid.density_kg_m3 * h);
  const double gradient = velocity * fluid.viscosity_pa_s / (h * h) * used.nz / box.nz;
  Forchheimer result;
  result.reynolds_per_velocity = 4 / (surface_per_mm * 1e3 * velocity * h);
  stokes::InertiaOptions options;
  options.tolerance = 1e-3;
  options.progress = [&](std::uint32_t, double) { return advance(0); };
  const auto points = stokes::sweep(*grid, stokes::Canonical::kAxis, kMaxReynolds / (result.reynolds_per_velocity * velocity),
                                    kPoints, options);
  if (!points) return points.error();
  for (const stokes::SweepPoint& point : *points) {
    result.settled = result.settled && point.settled;
    if (point.settled) result.points.push_back({point.velocity * velocity, point.force * gradient});
  }
  result.weak_reynolds = stokes::weak_up_to(*points) * velocity * result.reynolds_per_velocity;
  if (result.points.size() < 3 && !result.settled)
    return Error{Fault::kInput, "hardly any of these flows finds a steady state: k2 is not told"};
  const auto fit = segment::fit_permeability(result.points, fluid);
  if (!fit) return Error{fit.error().fault, "inertia hardly resists here, k2 is without bounds: " + fit.error().message};
  result.fit = *fit;
  return result;
}

}  // namespace

Result<Forchheimer> analyse_inertia(const PoreRasters& rasters, const PoreReport& report,
                                    const std::function<bool(double)>& advance) {
  if (report.porosity.percolating(2) == 0) return Error{Fault::kInput, "no void leads through along z: there is no k2"};
  Result<Forchheimer> result = sweep_through(rasters.fine, report.surface_per_mm, advance);
  if (!result) return result.error();
  const Result<Forchheimer> rough = sweep_through(rasters.coarse, report.surface_per_mm, advance);
  if (!rough && rough.error().fault != Fault::kInput) return rough.error();
  // Where pores are lost in larger voxels, these tell nothing: the error is the value.
  segment::Permeability& fit = result->fit;
  fit.k1_error_m2 = std::max(fit.k1_error_m2, std::abs(fit.k1_m2 - (rough ? rough->fit.k1_m2 : 0)));
  fit.k2_error_m = std::max(fit.k2_error_m, std::abs(fit.k2_m - (rough ? rough->fit.k2_m : 0)));
  return result;
}

}  // namespace lamina::pipeline
