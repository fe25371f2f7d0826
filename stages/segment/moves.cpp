#include "stages/segment/moves.h"

#include <algorithm>
#include <cmath>

#include "stages/geometry/bead_section.h"

namespace lamina::segment {

MoveTable::MoveTable(const Segmentation& plan, const LayerCut& cut, const Extruder& machine, const Layer& layer)
    : plan_(plan), cut_(cut), machine_(machine), height_(mm(layer.thickness)) {
  const double limit = layer.index == 0 ? machine.speed.first_layer_mm_s : INFINITY;
  reference_ = std::min(machine.speed.print_mm_s, limit);
  wall_ = std::min(machine.speed.wall_mm_s, limit);
  inner_ = std::min(machine.speed.inner_wall_mm_s, limit);
}

void MoveTable::make(const PathInterval& s, MoveEntry& entry) const {
  const auto& material = machine_.material;
  const double full = bead_area(mm(s.width), height_, material.shape()) * material.flow;
  // What is laid is as wide as a bead of that volume; only an ellipse is another shape in truth.
  const BeadShape deposited = material.shape() == BeadShape::kEllipse ? BeadShape::kEllipse : BeadShape::kStadium;
  const double width = bead_width(full, height_, deposited);
  const bool fills = s.kind != PathKind::kOuter && s.kind != PathKind::kInner;
  double share = 1, speed = 100, bead = fills && cut_.on ? plan_.continuous_width_mm : width;
  if (s.thickness == Thickness::kThick)
    share = plan_.thick_extrusion / 100, speed = plan_.thick_speed, bead = plan_.thick_width_mm;
  if (s.thickness == Thickness::kThin) {
    const auto thin = plan_.thin_of(cut_.ordinal(s.line));
    share = thin.extrusion / 100, speed = thin.speed, bead = thin.width_mm;
  }
  entry.stored = s.width;
  entry.width = static_cast<Nm>(nm_of(s.thickness == Thickness::kReference ? width : bead));
  entry.area = full * share;
  entry.measured = bead_area(bead, height_, deposited);
  const double reference = s.kind == PathKind::kOuter ? wall_ : s.kind == PathKind::kInner ? inner_ : reference_;
  entry.speed = reference * speed / 100;
}

}  // namespace lamina::segment
