#include "stages/infill/raft.h"

#include <algorithm>
#include <utility>

#include "stages/geometry/clipping.h"
#include "stages/infill/fill.h"

namespace lamina::infill {
namespace {

constexpr double kFirstDensity = 0.9, kMiddleDensity = 0.5;

double density_of(std::uint32_t layer, std::uint32_t layers) {
  if (layer == 0) return kFirstDensity;
  return layer + 1 == layers ? 1 : kMiddleDensity;
}

Box box_of(const ContoursView& region, const Layer& layer) {
  Box box;
  for (const Point2 p : region.point) {
    box.add(Point3{p.x, p.y, layer.bottom});
    box.add(Point3{p.x, p.y, layer.bottom + layer.thickness});
  }
  return box;
}

}  // namespace

Result<Contours> raft_region(const ContoursView& layer, Nm margin, std::array<std::int64_t, 2> bed) {
  Contours outer;
  for (std::uint32_t c = 0; c < layer.size(); ++c) {
    if (doubled_area(layer[c]) <= 0) continue;
    outer.point.insert(outer.point.end(), layer[c].begin(), layer[c].end());
    outer.close();
  }
  auto region = contour_union(outer, FillRule::kNonzero);
  if (region) region = offset_contours(*region, margin);
  if (region) region = contour_union(*region, FillRule::kNonzero);
  if (!region) return region;
  Contours whole_bed;
  const Nm x = static_cast<Nm>(bed[0]), y = static_cast<Nm>(bed[1]);
  for (const Point2 p : {Point2{0, 0}, {x, 0}, {x, y}, {0, y}}) whole_bed.point.push_back(p);
  whole_bed.close();
  return intersect_contours(*region, whole_bed);
}

Status append_raft(const ContoursView& region, const Layer& layer, std::uint32_t layers, const FillParameters& own,
                   Toolpaths& out) {
  FillParameters parameters = own;
  parameters.pattern = Pattern::kRaster;
  parameters.walls = 1;
  parameters.angle_base = 0;
  parameters.angle_step = kTurn / 4;
  parameters.density = density_of(layer.index, layers);
  parameters.top = parameters.bottom = 0;
  const FillContext context{layer, box_of(region, layer)};
  auto outlines = outlines_of(region, context, parameters);
  if (!outlines) return outlines.error();
  return append_fill(std::move(*outlines), context, parameters, out);
}

}  // namespace lamina::infill
