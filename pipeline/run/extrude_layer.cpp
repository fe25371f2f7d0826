#include "pipeline/run/extrude_layer.h"

#include "pipeline/plan/layer_cut.h"

namespace lamina::pipeline {

void LayerExtrusion::add(const LayerExtrusion& other) {
  totals.add(other.totals);
  segments.add(other.segments);
  porosity.add(other.porosity);
  points += other.points;
}

Result<std::optional<LayerExtrusion>> extrude_layer(const SlicePlan& plan, const SegmentPlan& segments, const Extruder& machine,
                                                    const ScheduledLayer& scheduled, const SlicePlan::Work& work,
                                                    const TextRoom& room, write::LayerMoves& out) {
  LayerExtrusion sums;
  const Layer layer = scheduled.own();
  sums.porosity.solid_mm3 = square_mm(doubled_area(work.contours.contours)) * mm(layer.thickness);
  sums.points = work.paths.point.size();
  const ToolpathsView all = work.paths;
  for (std::uint32_t a = 0; a + 1 < work.path_area.size(); ++a) {
    const SlicePlan::Area& area = plan.areas()[a];
    const Box& part = area.box;
    const SegmentRange& range = segments.at(std::int64_t{layer.plane()} - part.lo.z);
    const auto cut = layer_cut(range, plan.filling(area, layer), layer, part);
    if (!cut) return cut.error();
    segment::MoveTable table(range.plan, *cut, machine, layer);
    ToolpathsView paths = all;
    paths.offset = all.offset.subspan(work.path_area[a], work.path_area[a + 1] - work.path_area[a] + 1);
    const auto lay = [&](const BeadMove& move) -> std::optional<double> {
      const double length = out.lay(move);
      if (room.text.size() > room.most && !room.grown()) return std::nullopt;
      return length;
    };
    if (!segment::for_each_move(paths, *cut, table, sums.segments, sums.porosity, lay)) return std::optional<LayerExtrusion>();
  }
  sums.totals = out.finish();
  return std::optional(sums);
}

}  // namespace lamina::pipeline
