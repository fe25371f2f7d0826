#include "pipeline/pores/forward_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "pipeline/output/temporary_folder.h"
#include "pipeline/pores/bead_voxels.h"
#include "pipeline/pores/window_choice.h"
#include "pipeline/run/run.h"
#include "stages/formats/stl/mesh_stl.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {
namespace {

constexpr double kBlockMm = 12;  // a side: three periods and more, and walls around them

/// One period around the middle of the block, moved across the lines.
Window window_of(const formats::GcodeFile& file, const Pile::PileLayer& layer, const segment::Segmentation& plan,
                 const ForwardGrid& grid, double share_of_voxel) {
  const double across = 2 * plan.spacing_sc_mm + (plan.continuous - 1.0) * plan.spacing_cc_mm;
  const std::int64_t x = std::llround(1e6 * across), y = std::llround(1e6 * (plan.thick_mm + plan.thin_mm));
  const Point3 middle = file.box().middle();
  const auto moved = static_cast<Nm>(std::llround(1e3 * grid.across_um * share_of_voxel));
  Window window;
  const auto low_x = static_cast<Nm>(middle.x - x / 2 + moved), low_y = static_cast<Nm>(middle.y - y / 2);
  window.box.add(Point3{low_x, low_y, static_cast<Nm>(layer.low)});
  window.box.add(Point3{static_cast<Nm>(low_x + x), static_cast<Nm>(low_y + y), static_cast<Nm>(layer.high)});
  const std::array<double, 3> edge{grid.across_um, grid.along_um, grid.height_um};
  const std::array<std::int64_t, 3> length{x, y, layer.high - layer.low};
  for (std::size_t a = 0; a < 3; ++a)
    window.count[a] = static_cast<std::uint32_t>(std::max(4LL, std::llround(static_cast<double>(length[a]) * 1e-3 / edge[a])));
  window.periodic = {true, true, true};
  return window;
}

/// Plans the block. returns  what is said of its pores
Result<Json> print_block(Job job, double height_mm, const TemporaryFolder& folder) {
  if (const Status status = folder.status(); !status) return status.error();
  const std::string block = formats::stl::block({kBlockMm, kBlockMm, height_mm});
  if (const Status status = write_file(folder.file("block.stl"), block); !status) return status.error();
  job.parts = {{.path = folder.file("block.stl")}};
  job.output = folder.file("block.gcode");
  job.overwrite = job.quiet = true;
  const std::atomic<bool> never{false};  // takes milliseconds
  const auto summary = run(
      job, Product::kMoves, [](const ProgressEvent&) {}, never);
  if (!summary) return summary.error();
  return summary->facts.contains("pores") ? summary->facts.at("pores") : Json::array();
}

/// Voxels of a region, inspected at each position.
Result<ForwardRun> analyse_region(const formats::GcodeFile& file, const Pile& pile, const Pile::PileLayer& layer,
                                  const bead::DepositionRules* rules, const ForwardRegion& region, const ForwardGrid& grid,
                                  const std::function<bool(double)>& advance) {
  ForwardRun forward;
  FlowRequest request;
  request.axes = {false, false, true};
  request.tolerance = 1e-2;  // of the equations; k1 is within 0.1 % of what 1e-3 gives
  for (std::uint32_t i = 0; i < grid.positions; ++i) {
    const double done = i / static_cast<double>(grid.positions), part = 1.0 / grid.positions;
    const Window window = window_of(file, layer, region.plan, grid, done);
    std::vector<VoxelStack> cut;
    for (const Window& in : {window, finer(window, kFiner), finer(with_half_as_many_voxels(window), kFiner)}) {
      Result<VoxelStack> voxels = bead_voxels(file, pile, in, rules);
      if (!voxels) return voxels.error();
      cut.push_back(std::move(*voxels));
    }
    const auto report =
        analyse_pores({cut[0], cut[1], cut[2]}, request, [&](double share) { return advance(done + part * share); });
    if (!report) return report.error();
    const Darcy& along = *report->flow[2];
    forward.porosity += part * report->porosity.total();
    forward.porosity_through += part * report->porosity.percolating(2);
    forward.resolved = forward.resolved && along.resolved;
    forward.permeability_m2 += part * along.k_m2[2];
    forward.permeability_error_m2 += part * along.error_m2[2];
  }
  return forward;
}

}  // namespace

Result<std::vector<ForwardRun>> run_forward(Job job, const std::string& machine, double height_mm,
                                            const std::vector<ForwardRegion>& regions, const ForwardGrid& grid,
                                            const std::function<bool(double)>& advance) {
  const TemporaryFolder folder("design");
  const auto pores = print_block(std::move(job), height_mm, folder);
  if (!pores) return pores.error();
  const Result<formats::GcodeFile> file = formats::GcodeFile::open(folder.file("block.gcode"));
  if (!file) return file.error();
  const Result<Pile> pile = pile_of(*file);
  if (!pile) return pile.error();
  const Result<BeadRules> beads = bead_rules(*file, "", machine);
  if (!beads) return beads.error();
  std::vector<ForwardRun> all;
  for (const ForwardRegion& region : regions) {
    const std::int64_t z = std::llround(1e6 * region.middle_mm);
    const auto layer =
        std::ranges::find_if(pile->layers, [&](const Pile::PileLayer& one) { return one.low <= z && z < one.high; });
    if (layer == pile->layers.end())
      return Error{Fault::kInternal, fmt::format("the block of a forward run has no layer at {:g} mm", region.middle_mm)};
    const double done = static_cast<double>(all.size()), count = static_cast<double>(regions.size());
    auto forward = analyse_region(*file, *pile, *layer, beads->rules ? &*beads->rules : nullptr, region, grid,
                                  [&](double share) { return advance((done + share) / count); });
    if (!forward) return forward.error();
    for (const Json& deposited : *pores) {
      if (deposited.at("heights").get<std::string>() != region.heights) continue;
      forward->pore_length_mm = deposited.at("length_mm").get<double>();
      forward->pore_width_mm = deposited.at("width_mm").get<double>();
    }
    all.push_back(*forward);
  }
  return all;
}

Result<ForwardRun> run_forward(Job job, const std::string& machine, const segment::Segmentation& plan, const ForwardGrid& grid,
                               const std::function<bool(double)>& advance) {
  const double layer_mm = job.layer_mm;
  const auto all = run_forward(std::move(job), machine, 3 * layer_mm, {{plan, 1.5 * layer_mm, ""}}, grid, advance);
  if (!all) return all.error();
  return all->front();
}

}  // namespace lamina::pipeline
