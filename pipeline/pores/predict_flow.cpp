#include "pipeline/pores/predict_flow.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/pores/passages.h"
#include "stages/stokes/canonical.h"
#include "stages/stokes/flow.h"
#include "stages/stokes/inertia.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

constexpr std::uint32_t kFluidAtEnds = 4 * kFiner;  // fine voxels before each end of an axis that does not repeat

/// The box with fluid before both ends of an axis, which repeats then.
VoxelStack with_fluid_at_ends(const VoxelView& box, int axis) {
  VoxelStack longer(box.nx, box.ny, box.edge, box.periodic);
  longer.periodic[static_cast<std::size_t>(axis)] = true;
  const std::uint32_t x = axis == 0 ? kFluidAtEnds : 0, y = axis == 1 ? kFluidAtEnds : 0, z = axis == 2 ? kFluidAtEnds : 0;
  longer.nx += 2 * x;
  longer.ny += 2 * y;
  Runs slice;
  slice.columns = longer.nx;
  for (std::uint32_t k = 0; k < box.nz + 2 * z; ++k) {
    slice.row_offset.assign(1, 0);
    slice.change.clear();
    for (std::uint32_t r = 0; r < longer.ny; ++r) {
      if (k >= z && k < box.nz + z && r >= y && r < box.ny + y)
        for (const std::uint32_t c : box.row(r - y, k - z)) slice.change.push_back(c + x);
      slice.row_offset.push_back(static_cast<std::uint32_t>(slice.change.size()));
    }
    longer.append(slice);
  }
  return longer;
}

/// Where the cells of a turned box lie in the box as it is.
stokes::CellPositions positions_in_box(const stokes::Canonical& canonical, std::uint32_t finer,
                                       const std::array<std::uint32_t, 3>& turned_size, int axis) {
  stokes::CellPositions positions{stokes::cell_positions(canonical.view(), finer), {}, axis, stokes::Canonical::kAxis};
  for (std::array<std::uint32_t, 3>& at : positions.at) at = canonical.turn().in_box(at, turned_size);
  for (std::size_t c = 0; c < 3; ++c) positions.size[canonical.turn().from[c]] = turned_size[c];
  return positions;
}

/// Flow through one box along an axis, m2.
/// section  none, or where velocities go to
Result<Darcy> flow_along(const VoxelView& box, std::uint32_t finer, int axis, const FlowRequest& request,
                         const std::function<bool(double)>& advance, stokes::Section* section = nullptr) {
  const auto a = static_cast<std::size_t>(axis);
  const VoxelStack longer = box.periodic[a] ? VoxelStack() : with_fluid_at_ends(box, axis);
  const VoxelView used = box.periodic[a] ? box : longer.view();
  // However the window lies, the same digits.
  Result<stokes::Canonical> canonical = stokes::Canonical::of(used, axis);
  if (!canonical) return canonical.error();
  const Result<stokes::Grid> grid = stokes::make_grid(canonical->view(), finer, kFlowLevels);
  if (!grid) return grid.error();
  stokes::CellPositions positions;
  if (section != nullptr) positions = positions_in_box(*canonical, finer, grid->cells.box, axis);
  canonical->forget_voxels();
  stokes::Field field = stokes::field_of(grid->cells);
  stokes::FlowOptions options;
  options.tolerance = request.tolerance;
  options.progress = [&](std::uint32_t, double residual) {
    return advance(std::clamp(std::log(std::max(residual, 1e-12)) / std::log(request.tolerance), 0.0, 1.0));
  };
  const Result<stokes::Flow> flow = stokes::solve(*grid, stokes::Canonical::kAxis, options, field);
  if (!flow) return flow.error();
  const double along = flow->permeability[stokes::Canonical::kAxis];
  if (section != nullptr && along > 0)
    *section = stokes::section_of(std::move(positions), grid->cells, field, along, box.periodic[a] ? 0 : kFluidAtEnds / finer);
  // The force acts on the fluid at the ends too, where hardly anything resists.
  const double scaled = static_cast<double>(box.size()[a]) / used.size()[a];
  const std::array<double, 3> mean = canonical->in_box(flow->permeability);
  Darcy darcy;
  for (std::size_t b = 0; b < 3; ++b) darcy.k_m2[b] = mean[b] * (b == a ? scaled : 1) * grid->cells.unit_m * grid->cells.unit_m;
  darcy.tortuosity = flow->tortuosity;
  darcy.steps = flow->steps;
  darcy.residual = flow->residual;
  return darcy;
}

/// Of the voxels, extrapolated from those twice as large. The error is that step, or the least there is.
/// Where the two are too far apart, nothing is extrapolated, and the error is as large as the value.
void add_error(const Darcy& coarse, double ratio, double minimum, int axis, Darcy& fine) {
  const auto along = static_cast<std::size_t>(axis);
  const double whole = std::abs(fine.k_m2[along]);
  fine.resolved = ratio > 1.2 && std::abs(fine.k_m2[along] - coarse.k_m2[along]) <= 0.5 * whole;
  for (std::size_t b = 0; b < 3; ++b) {
    const double step = fine.resolved ? (fine.k_m2[b] - coarse.k_m2[b]) / (ratio * ratio - 1) : 0;
    fine.error_m2[b] = fine.resolved ? std::max(std::abs(step), minimum * std::abs(fine.k_m2[b])) : whole;
    if (fine.resolved) fine.k_m2[b] += step;
  }
}

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
    return Error{Fault::kInput, "fewer than 3 of these flows reach a steady state: k2 is unknown"};
  const auto fit = segment::fit_permeability(result.points, fluid);
  if (!fit) return Error{fit.error().fault, "inertia hardly resists here, k2 is without bounds: " + fit.error().message};
  result.fit = *fit;
  return result;
}

}  // namespace

Result<PoreReport> analyse_pores(const PoreRasters& rasters, const FlowRequest& request,
                                 const std::function<bool(double)>& advance) {
  const VoxelView &voxels = rasters.voxels, &fine = rasters.fine, &coarse = rasters.coarse;
  PoreReport report;
  report.voxels = voxels.voxels();
  report.empty = voxels.voxels() - set_voxels(voxels);
  std::uint64_t ends = 0;  // fluid before what does not repeat
  for (std::size_t a = 0; a < 3; ++a)
    if (!fine.periodic[a]) ends = std::max(ends, 2 * kFluidAtEnds / rasters.finer * voxels.voxels() / voxels.size()[a]);
  // Cells at walls count whose middles are solid, and so do distances for throats.
  const auto bytes_of = request.inertia ? stokes::bytes_of_inertia : stokes::bytes_of_flow;
  const std::uint64_t bytes = bytes_of(report.empty + report.empty / 8 + ends) + 5 * voxels.voxels() +
                              (request.section ? 12 * report.empty : 0);  // where cells lie
  if (bytes > request.memory_bytes) {
    const double larger = std::cbrt(static_cast<double>(bytes) / static_cast<double>(request.memory_bytes));
    return Error{Fault::kUsage,
                 fmt::format("the flow through {} voxels of void takes {}, --memory allows {}; take --voxel {:.3g} "
                             "or a smaller --window",
                             readable_count(report.empty), readable_bytes(bytes), readable_bytes(request.memory_bytes),
                             larger * voxels.edge[2] * 1e-3)};
  }
  report.porosity = pores::porosity(fine);
  report.surface_per_mm = pores::specific_surface(fine).crofton;
  if (report.empty < report.voxels) report.throat_mm = pores::throats(voxels, pores::whole(voxels), request.axes);
  const double edge_mm = *std::max_element(voxels.edge.begin(), voxels.edge.end()) * 1e-6;
  const double minimum = stokes::error_floor(report.porosity.total(), report.surface_per_mm * edge_mm, rasters.finer);
  const double ratio = static_cast<double>(fine.nx + fine.ny + fine.nz) / (coarse.nx + coarse.ny + coarse.nz);
  double maximum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    if (!request.axes[a]) continue;
    report.flow[a] = Darcy();
    if (report.porosity.percolating(axis) == 0) continue;
    const auto reported = [&](double from, double share) {
      return [&advance, axis, from, share](double done) { return advance((axis + from + share * done) / 3); };
    };
    const bool rough_leads = set_voxels(coarse) < coarse.voxels() && pores::porosity(coarse).percolating(axis) > 0;
    const Result<Darcy> rough =
        rough_leads ? flow_along(coarse, rasters.finer, axis, request, reported(0, 0.15)) : Result<Darcy>(Darcy());
    if (!rough) return rough.error();
    stokes::Section section;
    Result<Darcy> darcy =
        flow_along(fine, rasters.finer, axis, request, reported(0.15, 0.85), request.section ? &section : nullptr);
    if (!darcy) return darcy.error();
    add_error(*rough, ratio, minimum, axis, *darcy);
    if (!section.across.value.empty() && (axis == 2 || darcy->k_m2[a] > maximum)) report.section = std::move(section);
    maximum = std::max(maximum, darcy->k_m2[a]);
    report.flow[a] = *darcy;
  }
  return report;
}

Result<Forchheimer> analyse_inertia(const PoreRasters& rasters, const PoreReport& report,
                                    const std::function<bool(double)>& advance) {
  if (report.porosity.percolating(2) == 0) return Error{Fault::kInput, "no void is connected along z: there is no k2"};
  Result<Forchheimer> result = sweep_through(rasters.fine, report.surface_per_mm, advance);
  if (!result) return result.error();
  const Result<Forchheimer> rough = sweep_through(rasters.coarse, report.surface_per_mm, advance);
  if (!rough && rough.error().fault != Fault::kInput) return rough.error();
  // Where pores are lost in larger voxels, these give no estimate: the error is the value.
  segment::Permeability& fit = result->fit;
  fit.k1_error_m2 = std::max(fit.k1_error_m2, std::abs(fit.k1_m2 - (rough ? rough->fit.k1_m2 : 0)));
  fit.k2_error_m = std::max(fit.k2_error_m, std::abs(fit.k2_m - (rough ? rough->fit.k2_m : 0)));
  return result;
}

}  // namespace lamina::pipeline
