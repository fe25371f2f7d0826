#include "pipeline/run/extrude_layer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "stages/infill/parameters.h"
#include "stages/infill/spacing.h"
#include "stages/segment/bead.h"
#include "stages/segment/expand.h"

namespace lamina::pipeline {
namespace {

/// Ends of the part's box along a direction, nm.
std::array<double, 2> reach(const Box& part, double x, double y) {
  std::array<double, 2> ends{INFINITY, -INFINITY};
  for (const Nm px : {part.lo.x, part.hi.x}) {
    for (const Nm py : {part.lo.y, part.hi.y}) {
      const double along = x * px + y * py;
      ends = {std::min(ends[0], along), std::max(ends[1], along)};
    }
  }
  return ends;
}

/// Unit vector; exact for quarter turns.
std::array<double, 2> direction(infill::MicroDegrees angle) {
  if (angle == 0) return {1, 0};
  if (angle == infill::kTurn / 4) return {0, 1};
  const double radians = static_cast<double>(angle) * 1e-6 * std::numbers::pi / 180;
  return {std::cos(radians), std::sin(radians)};
}

/// What a machine does for each kind of stretch; made anew only where the stored width changes.
class MoveTable {
 public:
  MoveTable(const segment::Segmentation& plan, const segment::LayerCut& cut, const Extruder& machine, const Layer& layer)
      : plan_(plan), cut_(cut), on_(cut.on), height_(mm(layer.thickness)) {
    const double limit = layer.index == 0 ? machine.speed.first_layer_mm_s : INFINITY;
    reference_ = std::min(machine.speed.print_mm_s, limit);
    wall_ = std::min(machine.speed.wall_mm_s, limit);
    inner_ = std::min(machine.speed.inner_wall_mm_s, limit);
  }

  struct Entry {
    Nm stored = -1, width = 0;
    double area = 0, ellipse = 0, measured = 0, speed = 0;
  };

  const Entry& of(const Stretch& s) {
    if (s.thickness == Thickness::kThin && !plan_.sweep.empty()) {
      make(s, swept_);
      return swept_;
    }
    Entry& entry = table_[static_cast<std::size_t>(s.kind) * 3 + static_cast<std::size_t>(s.thickness)];
    if (entry.stored != s.width) make(s, entry);
    return entry;
  }

 private:
  void make(const Stretch& s, Entry& entry) {
    const double width = mm(s.width), full = segment::bead_area(width, height_);
    const bool fills = s.kind != PathKind::kOuter && s.kind != PathKind::kInner;
    double share = 1, speed = 100, bead = fills && on_ ? plan_.continuous_width_mm : width;
    if (s.thickness == Thickness::kThick)
      share = plan_.thick_extrusion / 100, speed = plan_.thick_speed, bead = plan_.thick_width_mm;
    if (s.thickness == Thickness::kThin) {
      const auto thin = plan_.thin_of(cut_.ordinal(s.line));
      share = thin.extrusion / 100, speed = thin.speed, bead = thin.width_mm;
    }
    entry.stored = s.width;
    entry.width = s.thickness == Thickness::kReference ? s.width : static_cast<Nm>(nm_of(bead));
    entry.area = full * share;
    entry.ellipse = segment::bead_area(width, height_, segment::BeadShape::kEllipse) * share;
    entry.measured = segment::bead_area(bead, height_);
    const double reference = s.kind == PathKind::kOuter ? wall_ : s.kind == PathKind::kInner ? inner_ : reference_;
    entry.speed = reference * speed / 100;
  }

  const segment::Segmentation& plan_;
  const segment::LayerCut& cut_;
  bool on_;
  double height_, reference_, wall_, inner_;
  std::array<Entry, 15> table_;
  Entry swept_;  // of a line of its own kind: not kept
};

}  // namespace

void LayerExtrusion::add(const LayerExtrusion& other) {
  totals.add(other.totals);
  segments.pieces += other.segments.pieces;
  segments.stretches += other.segments.stretches;
  segments.thin += other.segments.thin;
  segments.lines += other.segments.lines;
  porosity.solid_mm3 += other.porosity.solid_mm3;
  porosity.extruded_mm3 += other.porosity.extruded_mm3;
  porosity.ellipses_mm3 += other.porosity.ellipses_mm3;
  porosity.measured_mm3 += other.porosity.measured_mm3;
  points += other.points;
}

Result<segment::LayerCut> layer_cut(const SegmentRange& range, const infill::FillParameters& filling, const Layer& layer,
                                    const Box& part) {
  segment::LayerCut cut;
  cut.on = range.settings.on;
  if (!cut.on) return cut;
  const infill::MicroDegrees angle = infill::layer_angle(filling, layer.index) % (infill::kTurn / 2);
  const auto [x, y] = direction(angle);
  cut.along_x = x;
  cut.along_y = y;
  cut.continuous = range.plan.continuous;
  cut.first = range.settings.first;
  cut.one_direction = range.settings.one_direction;
  cut.line = {range.plan.rule, nm_of(range.plan.thin_mm), nm_of(range.plan.thick_mm), 0, nm_of(range.plan.least_end_mm)};
  cut.line.origin = std::llround(reach(part, x, y)[0]);
  if (range.settings.across) {
    // Where the segmented lines of a layer turned by 90 degrees lie: there the middles of thin stretches have to be.
    infill::FillParameters turned = filling;
    turned.angle_base = (angle + infill::kTurn / 4) % (infill::kTurn / 2);
    turned.angle_step = 0;
    const auto [cx, cy] = direction(turned.angle_base);
    const double across_x = -cy, across_y = cx;
    const auto [low, high] = reach(part, across_x, across_y);
    const auto place = infill::first_place(
        turned, {layer, part}, {std::llround(low), std::llround(high - low), std::llround(low), std::llround(high)});
    if (!place) return place.error();
    const double centre = (low + static_cast<double>(*place)) * (across_x * x + across_y * y);
    cut.line.origin = std::llround(centre) - cut.line.thin / 2;
  }
  const auto& shifts = range.settings.shift_mm;
  if (!shifts.empty()) {
    cut.shift = nm_of(shifts[layer.index % shifts.size()]);
    cut.line.origin += cut.shift;
  }
  return cut;
}

Status check_thin_stretches(const SegmentPlan& segments, const SlicePlan& plan) {
  // No straight line is longer than the parts are across; closed curves are.
  const double across =
      mm(std::llround(std::hypot(static_cast<double>(plan.bounds().width()), static_cast<double>(plan.bounds().depth()))));
  const auto too_long = [&](const SegmentRange& range) { return range.settings.on && range.plan.thin_mm >= across; };
  const auto longer = [&](const SegmentRange& range, const std::string& where) {
    return Error{
        Fault::kUsage,
        fmt::format("segment.thin_mm: {}{} mm is longer than any line in the parts, which are {:.3f} mm across; give less",
                    where, range.plan.thin_mm, across)};
  };
  if (!too_long(segments.base) && std::ranges::none_of(segments.ranges, too_long)) return {};
  for (const SlicePlan::Area& area : plan.areas()) {
    for (const ScheduledLayer& scheduled : plan.layers()) {
      const infill::Pattern pattern = plan.filling(area, scheduled.own()).pattern;
      if (pattern == infill::Pattern::kContour || pattern == infill::Pattern::kContourRaster) return {};
    }
  }
  if (too_long(segments.base)) return longer(segments.base, "");
  for (const SegmentRange& range : segments.ranges) {
    if (too_long(range)) return longer(range, fmt::format("{:g} to {:g} mm: ", mm(range.from), mm(range.to)));
  }
  return {};
}

Result<std::optional<LayerExtrusion>> extrude_layer(const SlicePlan& plan, const SegmentPlan& segments, const Extruder& machine,
                                                    const ScheduledLayer& scheduled, const SlicePlan::Work& work,
                                                    const TextRoom& room, write::LayerMoves& out) {
  LayerExtrusion sums;
  bool goes_on = true;
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
    MoveTable table(range.plan, *cut, machine, layer);
    ToolpathsView paths = all;
    paths.offset = all.offset.subspan(work.path_area[a], work.path_area[a + 1] - work.path_area[a] + 1);
    Point2 at{INT32_MIN, INT32_MIN};
    std::int32_t line = kNoLine;
    PathKind kind = PathKind::kOuter;
    Thickness before = Thickness::kReference;
    PlannedPorosity& volume = sums.porosity;
    segment::for_each_stretch(paths, *cut, [&](const Stretch& s) {
      if (!goes_on) return;
      const MoveTable::Entry& entry = table.of(s);
      const double length = out.lay({s.from, s.to, s.kind, s.jump, entry.width, entry.area, entry.speed});
      volume.extruded_mm3 += length * entry.area;
      volume.ellipses_mm3 += length * entry.ellipse;
      volume.measured_mm3 += length * entry.measured;
      if (room.text.size() > room.most) goes_on = room.grown();
      if (!cut->on) return;
      if (cut->segments(s.kind, s.line) && (s.line != line || s.kind != kind)) {
        ++sums.segments.lines;
        line = s.line;
        kind = s.kind;
      }
      if (s.thickness != Thickness::kReference) {
        const bool follows = s.from == at && before != Thickness::kReference;
        sums.segments.pieces += follows ? 0 : 1;
        // A curve's corners divide no stretch.
        const bool begins = !follows || s.thickness != before;
        sums.segments.stretches += begins ? 1 : 0;
        sums.segments.thin += begins && s.thickness == Thickness::kThin ? 1 : 0;
      }
      before = s.thickness;
      at = s.to;
    });
    if (!goes_on) return std::optional<LayerExtrusion>();
  }
  sums.totals = out.finish();
  return std::optional(sums);
}

}  // namespace lamina::pipeline
