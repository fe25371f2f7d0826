#include "stages/infill/brim.h"

#include <algorithm>
#include <cmath>
#include <ranges>
#include <vector>

#include "stages/geometry/clipping.h"
#include "stages/infill/gaps.h"

namespace lamina::infill {
namespace {

Contours outer_contours(const ContoursView& layer) {
  Contours outer;
  for (std::uint32_t c = 0; c < layer.size(); ++c) {
    if (doubled_area(layer[c]) <= 0) continue;
    outer.point.insert(outer.point.end(), layer[c].begin(), layer[c].end());
    outer.close();
  }
  return outer;
}

void append_closed_loops(const ContoursView& region, Contours& out) {
  for (std::uint32_t c = 0; c < region.size(); ++c) {
    out.point.insert(out.point.end(), region[c].begin(), region[c].end());
    out.point.push_back(region[c].front());
    out.close();
  }
}

/// Appends loops around islands in holes of other parts, which end where the hole does.
///
/// holes   of the region that is enclosed, without the islands in them
/// errors  kInternal of Clipper
Status append_island_loops(const ContoursView& holes, std::int64_t away, Contours& out) {
  if (std::ranges::none_of(std::views::iota(0u, holes.size()), [&](std::uint32_t c) { return doubled_area(holes[c]) < 0; }))
    return {};
  const auto shrunk = offset_contours(holes, -away);
  if (!shrunk) return shrunk.error();
  for (std::uint32_t c = 0; c < shrunk->size(); ++c) {
    if (doubled_area((*shrunk)[c]) >= 0) continue;
    out.point.insert(out.point.end(), (*shrunk)[c].rbegin(), (*shrunk)[c].rend());
    out.point.push_back((*shrunk)[c].back());
    out.close();
  }
  return {};
}

bool is_within(const ContoursView& lines, const ContoursView& box) {
  const Point2 low = box.point[0], high = box.point[2];
  return std::ranges::all_of(lines.point,
                             [&](Point2 p) { return p.x >= low.x && p.y >= low.y && p.x <= high.x && p.y <= high.y; });
}

}  // namespace

Result<Contours> brim_around(const ContoursView& layer, const BrimSettings& settings, std::array<std::int64_t, 2> bed) {
  std::vector<Contours> loops;
  // Not strictly simple: that takes long where a brim has thousands of corners.
  auto region = contour_union(outer_contours(layer), FillRule::kNonzero, false);
  const auto holes = region ? subtract_contours(*region, layer, false) : region;
  if (!holes) return holes;
  double at = 0;
  for (double next = settings.pitch / 2; region && next <= static_cast<double>(settings.reach); next += settings.pitch) {
    auto grown = offset_contours(*region, std::llround(next) - std::llround(at));
    region = std::move(grown);
    at = next;
    if (!region) return region;
    append_closed_loops(*region, loops.emplace_back());
    if (Status status = append_island_loops(*holes, std::llround(next), loops.back()); !status) return status.error();
  }
  const Nm half = settings.width / 2;
  const Nm x = static_cast<Nm>(bed[0] - half), y = static_cast<Nm>(bed[1] - half);
  Contours within;
  for (const Point2 p : {Point2{half, half}, {x, half}, {x, y}, {half, y}}) within.point.push_back(p);
  within.close();
  Contours brim;
  for (std::size_t i = loops.size(); i-- > 0;) {
    if (is_within(loops[i], within)) {
      brim.append(loops[i]);
      continue;
    }
    const auto pieces = clip_lines(loops[i], within);
    if (!pieces) return pieces.error();
    brim.append(*pieces);
  }
  return brim;
}

Result<Contours> without_elephant_foot(const ContoursView& contours, Nm inset, Nm width) {
  auto moved = offset_contours(contours, -std::int64_t{inset});
  if (!moved) return moved;
  const std::int64_t half = inset + width / 2;
  const auto centres = offset_contours(contours, -half);
  const auto narrow = centres ? narrow_part(contours, *centres, half) : centres;
  if (!narrow) return narrow.error();
  if (narrow->size() == 0) return moved;
  constexpr Nm kOverlap = 10'000;  // nm: what stays as it is reaches what has moved
  auto kept = offset_contours(*narrow, inset + kOverlap);
  if (kept) kept = intersect_contours(*kept, contours, false);
  if (!kept) return kept;
  Contours both = std::move(*moved);
  both.append(*kept);
  return contour_union(both, FillRule::kNonzero);
}

}  // namespace lamina::infill
