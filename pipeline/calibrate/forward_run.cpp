#include "pipeline/calibrate/forward_run.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>

#include "pipeline/calibrate/bead_rules.h"
#include "pipeline/calibrate/bead_voxels.h"
#include "pipeline/calibrate/window_choice.h"
#include "pipeline/run/run.h"
#include "stages/data/text/json.h"
#include "stages/write/file.h"
#include "stages/write/stl/block.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr double kBlockMm = 12;  // a side: three periods and more, and walls around them

/// A folder that is gone when it is left.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::error_code none;
    std::string name = (fs::temp_directory_path(none) / "lamina_design_XXXXXX").string();
    if (!none && mkdtemp(name.data()) != nullptr) path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  bool made() const { return !path_.empty(); }
  std::string file(const char* name) const { return (fs::path(path_) / name).string(); }

 private:
  std::string path_;
};

/// One period around the middle of the block, moved across the lines.
Window window_of(const read::GcodeFile& file, const Pile::Layer& layer, const segment::Segmentation& plan,
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

/// Plans the block. returns  the mean length and width of its pores
Result<std::array<double, 2>> lay_block(Job job, const TemporaryFolder& folder) {
  if (!folder.made())
    return Error{Fault::kOutput, "no temporary folder can be made; TMPDIR names the folder that they are made in"};
  const std::string block = write::stl::block({kBlockMm, kBlockMm, 3 * job.layer_mm});
  if (const Status status = write::write_file(folder.file("block.stl"), block); !status) return status.error();
  job.parts = {{.path = folder.file("block.stl")}};
  job.output = folder.file("block.gcode");
  job.overwrite = job.quiet = true;
  const std::atomic<bool> never{false};  // takes milliseconds
  const auto summary = run(
      job, Product::kMoves, [](const ProgressEvent&) {}, never);
  if (!summary) return summary.error();
  std::array<double, 2> pore{};
  if (summary->facts && summary->facts->contains("pores") && !summary->facts->at("pores").empty()) {
    const auto& all = summary->facts->at("pores").front();
    pore = {all.at("length_mm").get<double>(), all.at("width_mm").get<double>()};
  }
  return pore;
}

}  // namespace

Result<ForwardRun> run_forward(Job job, const std::string& machine, const segment::Segmentation& plan, const ForwardGrid& grid,
                               const std::function<bool(double)>& tell) {
  const TemporaryFolder folder;
  const auto pore = lay_block(std::move(job), folder);
  if (!pore) return pore.error();
  const Result<read::GcodeFile> file = read::GcodeFile::open(folder.file("block.gcode"));
  if (!file) return file.error();
  const Result<Pile> pile = pile_of(*file);
  if (!pile) return pile.error();
  if (pile->layers.size() < 2) return Error{Fault::kInternal, "the block of a forward run has no layer in its middle"};
  const Result<BeadRules> beads = bead_rules(*file, "", machine);
  if (!beads) return beads.error();
  ForwardRun forward;
  forward.pore_length_mm = pore->at(0);
  forward.pore_width_mm = pore->at(1);
  FlowRequest request;
  request.axes = {false, false, true};
  request.tolerance = 1e-2;  // of the equations; k1 is within 0.1 % of what 1e-3 gives
  for (std::uint32_t i = 0; i < grid.places; ++i) {
    const double done = i / static_cast<double>(grid.places), part = 1.0 / grid.places;
    const Window window = window_of(*file, pile->layers[1], plan, grid, done);
    std::vector<VoxelStack> cut;
    for (const Window& in : {window, finer(window, kFiner), finer(with_half_as_many_voxels(window), kFiner)}) {
      Result<VoxelStack> voxels = bead_voxels(*file, *pile, in, beads->rules ? &*beads->rules : nullptr);
      if (!voxels) return voxels.error();
      cut.push_back(std::move(*voxels));
    }
    const auto report =
        look_at_pores({cut[0], cut[1], cut[2]}, request, [&](double share) { return tell(done + part * share); });
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

}  // namespace lamina::pipeline
