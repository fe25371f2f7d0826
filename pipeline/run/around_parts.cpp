#include "pipeline/run/around_parts.h"

#include <array>

#include "stages/infill/brim.h"
#include "stages/infill/density.h"
#include "stages/infill/raft.h"
#include "stages/infill/skirt.h"
#include "stages/segment/moves.h"
#include "stages/slice/bodies.h"

namespace lamina::pipeline {
namespace {

/// Straight beads that are not of the parts, as fast as walls.
class AuxiliaryBeads {
 public:
  /// kind  of the beads, as they are named in the file; as  whose speed they have
  AuxiliaryBeads(const Plan& plan, const Layer& layer, PathKind kind, PathKind as, formats::LayerMoves& out)
      : table_(plan.segments->base.plan, uncut_, plan.moves->profile.machine, layer), kind_(kind), as_(as), out_(out) {}

  void add(const Contours& lines, Nm width) {
    for (std::uint32_t c = 0; c < lines.size(); ++c) {
      for (std::size_t i = 0; i + 1 < lines[c].size(); ++i) add(lines[c][i], lines[c][i + 1], width, i == 0);
    }
  }
  void add(const ToolpathsView& paths) {
    for (std::uint32_t p = 0; p < paths.size(); ++p) {
      for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i)
        add(paths.point[i], paths.point[i + 1], paths.width[i], i == paths.offset[p]);
    }
  }

 private:
  void add(Point2 from, Point2 to, Nm width, bool begins) {
    if (from == to) return;
    PathInterval interval{};
    interval.from = from;
    interval.to = to;
    interval.kind = as_;
    interval.width = width;
    interval.line = kNoLine;
    const segment::MoveTable::MoveEntry& entry = table_.of(interval);
    out_.deposit({from, to, kind_, begins, entry.width, entry.area, entry.speed});
  }

  segment::LayerCut uncut_{};
  segment::MoveTable table_;
  PathKind kind_, as_;
  formats::LayerMoves& out_;
};

Nm first_width(const Plan& plan) {
  const FillSettings& fill = plan.job.fill.all;
  return static_cast<Nm>(
      nm_of(plan.job.extrude.first_bead_mm.value_or(fill.wall_width_mm > 0 ? fill.wall_width_mm : fill.width_mm)));
}

std::array<std::int64_t, 2> bed_of(const Extruder& machine) {
  return {nm_of(machine.bed.size_mm[0]), nm_of(machine.bed.size_mm[1])};
}

/// beyond  nm that are deposited around the parts
void deposit_skirt(const Plan& plan, const Layer& layer, Nm beyond, formats::LayerMoves& out) {
  const Extruder& machine = plan.moves->profile.machine;
  const Nm width = first_width(plan);
  const Box around = slice::grown(plan.sections->bounds(), beyond);
  AuxiliaryBeads beads(plan, layer, PathKind::kSkirt, PathKind::kOuter, out);
  beads.add(infill::skirt_around(around, machine.skirt, width, bed_of(machine)), width);
}

}  // namespace

Status deposit_around(const Plan& plan, const Layer& layer, const ContoursView& contours, formats::LayerMoves& out) {
  const Extruder& machine = plan.moves->profile.machine;
  const ExtrudeRequest& request = plan.job.extrude;
  if (request.raft_layers > 0) return {};
  const std::int64_t reach = nm_of(request.brim_mm);
  deposit_skirt(plan, layer, static_cast<Nm>(reach), out);
  if (reach == 0 || layer.bottom > 0) return {};
  const Nm width = first_width(plan);
  infill::FillParameters parameters;
  parameters.shape = machine.material.shape();
  const double pitch = infill::solid_pitch(parameters, width, layer.thickness);
  const auto foot = static_cast<Nm>(nm_of(request.elephant_foot_mm));
  Result<Contours> printed = Contours();
  if (foot > 0) printed = infill::without_elephant_foot(contours, foot, width);
  if (!printed) return printed.error();
  const auto brim = infill::brim_around(foot > 0 ? ContoursView(*printed) : contours, {reach, width, pitch}, bed_of(machine));
  if (!brim) return brim.error();
  AuxiliaryBeads(plan, layer, PathKind::kSkirt, PathKind::kOuter, out).add(*brim, width);
  return {};
}

Result<std::vector<formats::MoveTotals>> append_raft(const Plan& plan, const ToolpathFile& file, const ContoursView& contours,
                                                     const ProgressEstimate& progress, Buffer<char>& text) {
  std::vector<formats::MoveTotals> sums;
  const RaftPlan& raft = file.raft();
  if (raft.layers.empty()) return sums;
  const Extruder& machine = plan.moves->profile.machine;
  const auto margin = static_cast<Nm>(nm_of(plan.job.extrude.raft_margin_mm));
  const auto region = infill::raft_region(contours, margin, bed_of(machine));
  if (!region) return region.error();
  infill::FillParameters own;
  own.shape = machine.material.shape();
  for (const Layer& layer : raft.layers) {
    own.width = own.wall_width = layer.index == 0 ? first_width(plan) : static_cast<Nm>(nm_of(plan.job.fill.all.width_mm));
    own.nominal_thickness = layer.thickness;
    Toolpaths paths;
    if (Status status = infill::append_raft(*region, layer, static_cast<std::uint32_t>(raft.layers.size()), own, paths);
        !status)
      return status.error();
    const auto out = file.raft_layer(layer, text, progress.before_raft(layer.index));
    if (layer.index == 0) deposit_skirt(plan, layer, margin, *out);
    AuxiliaryBeads(plan, layer, PathKind::kSupport, PathKind::kInner, *out).add(paths);
    formats::MoveTotals totals = out->finish();
    if (!sums.empty()) file.travel_from(sums.back(), totals);
    sums.push_back(totals);
  }
  return sums;
}

}  // namespace lamina::pipeline
