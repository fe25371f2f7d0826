#include "pipeline/run/path_layer.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "pipeline/plan/layer_cut.h"
#include "stages/segment/moves.h"

namespace lamina::pipeline {
double length_mm(const ToolpathsView& paths) {
  double sum = 0;
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      const Point2 a = paths.point[i], b = paths.point[i + 1];
      sum += std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
    }
  }
  return sum * 1e-6;
}

PathFacts facts_of(const Sections::Work& work) {
  PathFacts facts;
  const Contours& contours = work.contours.contours;
  facts.contours = contours.size();
  facts.points = contours.point.size();
  facts.paths = work.paths.size();
  facts.united = work.report.united;
  facts.open = work.report.gaps.open;
  facts.area_mm2 = square_mm(doubled_area(contours));
  facts.stored_points = work.paths.point.size();
  return facts;
}

Result<bool> lay_moves(const Plan& plan, std::uint32_t index, const Sections::Work& work, const TextRoom& room,
                       write::LayerMoves& out, PathFacts& facts) {
  const Sections& sections = *plan.sections;
  const Layer layer = sections.layers()[index].own();
  const ToolpathsView all = work.paths;
  PathFacts laid;
  laid.porosity.solid_mm3 = facts.area_mm2 * mm(layer.thickness);
  for (std::uint32_t a = 0; a + 1 < work.path_area.size(); ++a) {
    const Sections::Area& area = sections.areas()[a];
    const SegmentRange& range = plan.segments->at(std::int64_t{layer.plane()} - area.box.lo.z);
    const auto cut = layer_cut(range, sections.filling(area, layer), layer, area.box);
    if (!cut) return cut.error();
    segment::MoveTable table(range.plan, *cut, plan.moves->profile.machine, layer);
    ToolpathsView paths = all;
    paths.offset = all.offset.subspan(work.path_area[a], work.path_area[a + 1] - work.path_area[a] + 1);
    if (Status status = check_stretch_count(range, *cut, paths, layer); !status) return status.error();
    const auto lay = [&](const BeadMove& move) -> std::optional<double> {
      const double length = out.lay(move);
      if (room.text.size() > room.most && !room.grown()) return std::nullopt;
      return length;
    };
    if (!segment::for_each_move(paths, *cut, table, laid.segments, laid.porosity, lay)) return false;
  }
  facts.totals = out.finish();
  facts.segments = laid.segments;
  facts.porosity = laid.porosity;
  return true;
}

void LayersTold::add(const Layer& layer) {
  if (++count > 1) return;
  index = layer.index;
  z_mm = mm(layer.plane());
  first = fmt::format("layer {} at z {:.3f} mm", index, z_mm);
}

void LayersTold::warn(std::string_view code, std::string text, std::vector<Warning>& warnings) const {
  if (count > 0) warnings.push_back({std::string(code), std::move(text), "", index, z_mm});
}

}  // namespace lamina::pipeline
