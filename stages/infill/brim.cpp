#include "stages/infill/brim.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/components.h"
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

/// The islands in a hole, and where loops around them may be.
struct Islands {
  Contours outlines, free;
};
/// Of each hole with islands.
/// enclosed  the region within the outer contours of the layer
/// errors    kInternal of Clipper
Result<std::vector<Islands>> islands_of(const ContoursView& enclosed, const ContoursView& layer, double pitch) {
  const auto holes = subtract_contours(enclosed, layer, false);
  if (!holes) return holes.error();
  std::vector<Islands> all;
  Status status;
  for_each_component(*holes, [&](std::uint32_t begin, std::uint32_t end) {
    if (end == begin + 1 || !status) return;
    Buffer<std::uint32_t> rebased;
    auto free = offset_contours(range_of(*holes, begin, begin + 1, rebased), -std::llround(pitch / 2));
    if (!free) {
      status = free.error();
      return;
    }
    Contours outlines;
    for (std::uint32_t c = begin + 1; c < end; ++c) {
      outlines.point.insert(outlines.point.end(), (*holes)[c].rbegin(), (*holes)[c].rend());
      outlines.close();
    }
    all.push_back({std::move(outlines), std::move(*free)});
  });
  if (!status) return status.error();
  return all;
}

/// Appends what of closed loops is in a region. Clipping cuts a loop where it begins; the pieces there are one again.
/// errors  kInternal of Clipper
Status append_within(const Contours& loops, const ContoursView& region, Contours& out) {
  const auto pieces = clip_lines(loops, region);
  if (!pieces) return pieces.error();
  std::map<Point2, std::uint32_t> ends;  // of pieces that end where a loop begins
  std::set<Point2> begins;
  for (std::uint32_t c = 0; c < loops.size(); ++c) begins.insert(loops[c].front());
  const auto closed = [&](std::uint32_t c) { return (*pieces)[c].front() == (*pieces)[c].back(); };
  for (std::uint32_t c = 0; c < pieces->size(); ++c)
    if (!closed(c) && begins.contains((*pieces)[c].back())) ends.emplace((*pieces)[c].back(), c);
  std::vector<bool> used(pieces->size());
  const auto append = [&](std::span<const Point2> points) { out.point.insert(out.point.end(), points.begin(), points.end()); };
  for (std::uint32_t c = 0; c < pieces->size(); ++c) {
    const auto before = closed(c) ? ends.end() : ends.find((*pieces)[c].front());
    if (before == ends.end() || before->second == c || used[c] || used[before->second]) continue;
    append((*pieces)[before->second]);
    append((*pieces)[c].subspan(1));
    out.close();
    used[c] = used[before->second] = true;
  }
  for (std::uint32_t c = 0; c < pieces->size(); ++c) {
    if (used[c]) continue;
    append((*pieces)[c]);
    out.close();
  }
  return {};
}

/// Appends loops around islands; what would be on the surrounding part is cut off.
Status append_island_loops(const Islands& islands, std::int64_t away, Contours& out) {
  const auto grown = offset_contours(islands.outlines, away);
  if (!grown) return grown.error();
  Contours loops;
  for (std::uint32_t c = 0; c < grown->size(); ++c) {
    if (doubled_area((*grown)[c]) <= 0) continue;
    loops.point.insert(loops.point.end(), (*grown)[c].begin(), (*grown)[c].end());
    loops.point.push_back((*grown)[c].front());
    loops.close();
  }
  return append_within(loops, islands.free, out);
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
  const auto islands = region ? islands_of(*region, layer, settings.pitch) : Result<std::vector<Islands>>(region.error());
  if (!islands) return islands.error();
  double at = 0;
  for (double next = settings.pitch / 2; region && next <= static_cast<double>(settings.reach); next += settings.pitch) {
    auto grown = offset_contours(*region, std::llround(next) - std::llround(at));
    region = std::move(grown);
    at = next;
    if (!region) return region;
    append_closed_loops(*region, loops.emplace_back());
    for (const Islands& of_hole : *islands) {
      if (Status status = append_island_loops(of_hole, std::llround(next), loops.back()); !status) return status.error();
    }
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
    if (Status status = append_within(loops[i], within, brim); !status) return status.error();
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
