#include "pipeline/run/path_layer.h"
#include "pipeline/plan/heights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/plan/layer_cut.h"
#include "pipeline/report/move_observers.h"
#include "stages/bead/even_starts.h"
#include "stages/infill/skirt.h"
#include "stages/segment/deposited/pores.h"
#include "stages/segment/moves.h"

namespace lamina::pipeline {
namespace {

/// Lays the skirt, as fast and as wide as a wall. The first layer of a job that begins at the bed has one, with beads or not.
void deposit_skirt(const Plan& plan, const Layer& layer, formats::LayerMoves& out) {
  const Extruder& machine = plan.moves->profile.machine;
  const FillSettings& fill = plan.job.fill.all;
  const auto width = static_cast<Nm>(nm_of(fill.wall_width_mm > 0 ? fill.wall_width_mm : fill.width_mm));
  const Contours skirt = infill::skirt_around(plan.sections->bounds(), machine.skirt, width,
                                              {nm_of(machine.bed.size_mm[0]), nm_of(machine.bed.size_mm[1])});
  const segment::LayerCut uncut{};
  segment::MoveTable table(plan.segments->base.plan, uncut, machine, layer);
  for (std::uint32_t c = 0; c < skirt.size(); ++c) {
    for (std::size_t i = 0; i + 1 < skirt[c].size(); ++i) {
      PathInterval interval{};
      interval.from = skirt[c][i];
      interval.to = skirt[c][i + 1];
      interval.kind = PathKind::kOuter;
      interval.width = width;
      interval.line = kNoLine;
      const segment::MoveTable::MoveEntry& entry = table.of(interval);
      out.deposit({interval.from, interval.to, PathKind::kSkirt, i == 0, entry.width, entry.area, entry.speed});
    }
  }
}

ToolpathsView paths_of(const Sections::Work& work, std::uint32_t area) {
  ToolpathsView paths = work.paths;
  paths.offset = paths.offset.subspan(work.path_area[area], work.path_area[area + 1] - work.path_area[area] + 1);
  return paths;
}

/// The segmentation of an area at a layer, and its cut. errors  of layer_cut
struct AreaCut {
  const SegmentRange& range;
  Result<segment::LayerCut> cut;
};
AreaCut cut_of(const Plan& plan, std::uint32_t area_number, const Layer& layer) {
  const Sections::Area& area = plan.sections->areas()[area_number];
  const SegmentRange& range = plan.segments->at(Sections::height_in(area, layer));
  return {range, layer_cut(range, plan.sections->filling(area, layer), layer, area.box)};
}

/// The pores of a layer by segmented range, in a job that tells them so.
class PoresByRange {
 public:
  explicit PoresByRange(const Plan& plan) {
    if (has_ranges_by_layer(plan)) segmented_ = plan.segments->segmented();
    ranges.resize(segmented_.size());
  }
  /// What `count` adds to `all` is added to the range too. returns  what it returns
  template <class SampleCount>
  auto take(const SegmentRange& range, PoreCounts& all, SampleCount count) {
    if (ranges.empty()) return count();
    const PoreCounts before = std::exchange(all, {});
    const auto result = count();
    if (RangePores* of = find(range)) of->pores.add(all);
    PoreCounts sum = before;
    sum.add(all);
    all = sum;
    return result;
  }
  RangePores* find(const SegmentRange& range) {
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      if (segmented_[i].second == &range) return &ranges[i];
    }
    return nullptr;
  }
  std::vector<RangePores> ranges;

 private:
  decltype(std::declval<SegmentPlan>().segmented()) segmented_;
};

/// Counts pores that cross those of the part's next layer, which is made for it. errors  of Sections::layer and layer_cut
Status count_crossed(const Plan& plan, std::uint32_t index, const Sections::Work& work, PoreCounts& all,
                     PoresByRange& by_range) {
  const std::vector<ScheduledLayer>& layers = plan.sections->layers();
  std::uint32_t next = index + 1;
  while (next < layers.size() && layers[next].part != layers[index].part) ++next;
  if (next >= layers.size()) return {};
  Sections::Work above;
  if (Status status = plan.sections->layer(next, above); !status) return status;
  for (std::uint32_t a = 0; a + 1 < work.path_area.size(); ++a) {
    const AreaCut below = cut_of(plan, a, layers[index].own()), over = cut_of(plan, a, layers[next].own());
    if (!below.cut) return below.cut.error();
    if (!over.cut) return over.cut.error();
    if (!below.range.settings.across || !over.range.settings.across) continue;
    by_range.take(below.range, all, [&] {
      segment::count_crossed(paths_of(work, a), *below.cut, paths_of(above, a), *over.cut, all);
      return true;
    });
  }
  return {};
}

}  // namespace

PathFacts facts_of(const Sections::Work& work) {
  PathFacts facts;
  const Contours& contours = work.contours.contours;
  facts.contours = contours.size();
  facts.points = contours.point.size();
  facts.paths = work.paths.size();
  facts.merged = work.report.merged;
  facts.open = work.report.gaps.open;
  facts.stored_points = work.paths.point.size();
  return facts;
}

Result<bool> deposit_moves(const Plan& plan, std::uint32_t index, const Sections::Work& work, const TextBuffer& buffer,
                           formats::LayerMoves& out, PathFacts& facts) {
  const Layer layer = plan.sections->layers()[index].own();
  DepositedSums deposited;
  deposited.porosity.solid_mm3 = facts.area_mm2 * mm(layer.thickness);
  PoresByRange by_range(plan);
  const Extruder& machine = plan.moves->profile.machine;
  bead::EvenStarts starts(machine, mm(layer.thickness));
  if (index == 0 && plan.sections->fills()) deposit_skirt(plan, layer, out);
  for (std::uint32_t a = 0; a + 1 < work.path_area.size(); ++a) {
    const AreaCut of = cut_of(plan, a, layer);
    const SegmentRange& range = of.range;
    const Result<segment::LayerCut>& cut = of.cut;
    if (!cut) return cut.error();
    segment::MoveTable table(range.plan, *cut, machine, layer);
    const ToolpathsView paths = paths_of(work, a);
    if (Status status = segment::check_interval_count(range.plan, *cut, paths, layer.index); !status) return status.error();
    const auto write = [&](const BeadMove& move) -> std::optional<DepositedMove> {
      const double length = out.deposit(move);
      if (buffer.text.size() > buffer.maximum && !buffer.grown()) return std::nullopt;
      return DepositedMove{length, length * move.area_mm2};
    };
    const bool even = range.settings.on && range.settings.even_starts && machine.material.lag_s > 0;
    if (!even) starts.forget();
    const auto deposit = [&](const BeadMove& move) { return even ? starts.deposit(move, write) : write(move); };
    if (!by_range.take(range, deposited.pores, [&] { return segment::for_each_move(paths, *cut, table, deposited, deposit); }))
      return false;
    if (RangePores* reported = by_range.find(range))
      reported->area_mm2 += plan.sections->area_mm2(plan.sections->areas()[a], work);
  }
  facts.totals = out.finish();
  if (plan.segments->crosses()) {
    if (Status status = count_crossed(plan, index, work, deposited.pores, by_range); !status) return status.error();
  }
  facts.deposited = deposited;
  facts.by_range = std::move(by_range.ranges);
  return true;
}

}  // namespace lamina::pipeline
