#include "stages/checks/overhangs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "stages/geometry/box_clip.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/components.h"

namespace lamina::checks {
namespace {

constexpr std::int64_t kRounding = 4;  // nm: points of both sections, the reach, and edges of its offset

/// The reach less what rounding may add to the growth of a face, but more than that of vertical walls.
std::int64_t certain(std::int64_t reach) { return std::max(reach - kRounding, kRounding); }

/// The contours below that components can meet once they grow.
Contours below_components(const ContoursView& components, const RegionBelow& below, std::int64_t reach) {
  std::vector<PlanarBox> boxes;
  for (std::uint32_t c = 0; c < components.size(); ++c)
    if (doubled_area(components[c]) > 0) boxes.push_back(box_around(components[c]));
  Contours met;
  for (std::uint32_t c = 0; c < below.contours.size(); ++c) {
    const auto meets = [&](const PlanarBox& box) { return below.box[c].meets(box, 2 * reach + kRounding); };
    if (std::ranges::none_of(boxes, meets)) continue;
    met.point.insert(met.point.end(), below.contours[c].begin(), below.contours[c].end());
    met.close();
  }
  return met;
}

/// Whether a component shares no area with the region below. errors  of subtract_contours
Result<bool> is_separate(const ContoursView& component, const RegionBelow& below) {
  const auto fresh = subtract_contours(component, below_components(component, below, 0), false);
  if (!fresh) return fresh.error();
  return doubled_area(*fresh) == doubled_area(component);
}

/// A part of the layer in which boolean operations are made, and what hangs in it.
struct Extract {
  PlanarBox box;
  Contours hanging;
  bool done = false;
};

/// Joins boxes until no two meet.
void join_boxes(std::vector<Extract>& extracts) {
  for (std::size_t i = 0; i < extracts.size(); ++i) {
    for (std::size_t k = 0; k < extracts.size();) {
      if (k == i || !extracts[i].box.meets(extracts[k].box)) {
        ++k;
        continue;
      }
      extracts[i].box.add(extracts[k].box);
      extracts[i].done = false;
      extracts.erase(extracts.begin() + static_cast<std::ptrdiff_t>(k));
      if (k < i) --i;
      k = 0;
    }
  }
}

Contours part_in(const ContoursView& contours, const PlanarBox& box) {
  Contours part;
  clip_to_box(contours, box.lo, box.hi, part);
  return part;
}

/// Finds what hangs in an extract of components that share area with the region below. Where it reaches the sides, the box
/// becomes larger instead. all  the box around the components
Status extract_hanging(const ContoursView& components, const ContoursView& met, std::int64_t reach, const PlanarBox& all,
                       Extract& extract) {
  const std::int64_t margin = 2 * reach + 8 * kRounding;  // corners of offsets are at most twice the distance away
  const PlanarBox around_box = grown(extract.box, 2 * margin);
  const Contours own = part_in(components, extract.box), below = part_in(met, around_box);
  const auto carrying = offset_contours(below, certain(reach));
  if (!carrying) return carrying.error();
  const auto far = subtract_contours(own, *carrying, false);
  if (!far) return far.error();
  extract.done = true;
  if (far->size() == 0) return {};
  const PlanarBox needed = grown(box_around(far->point), margin);
  if (!is_within(needed, extract.box) && !is_within(all, extract.box)) {
    extract.done = false;
    extract.box.add(needed);
    const std::int64_t size =
        std::max(std::int64_t{extract.box.hi.x} - extract.box.lo.x, std::int64_t{extract.box.hi.y} - extract.box.lo.y);
    extract.box = grown(extract.box, std::max(margin, size / 4));
    return {};
  }
  const auto around = offset_contours(*far, reach + 2 * kRounding);
  if (!around) return around.error();
  // In this order only edges that are next to what hangs are compared with those below, which they may nearly coincide with.
  const auto near = intersect_contours(own, *around, false);
  if (!near) return near.error();
  auto hanging = subtract_contours(*near, below, false);
  if (!hanging) return hanging.error();
  extract.hanging = std::move(*hanging);
  return {};
}

/// Appends what hangs of components that share area with the region below.
/// uncarried  boxes, all that is beyond the reach is connected to one of them
Status append_hanging(const ContoursView& components, const RegionBelow& below, std::int64_t reach,
                      const std::vector<PlanarBox>& uncarried, Contours& out) {
  const Contours met = below_components(components, below, reach);
  std::vector<Extract> extracts;
  for (const PlanarBox& box : uncarried) {
    const PlanarBox larger = grown(box, 3 * reach + 16 * kRounding);
    if (!extracts.empty() && extracts.back().box.meets(larger)) {
      extracts.back().box.add(larger);
    } else {
      extracts.push_back({larger, {}});
    }
  }
  const PlanarBox all = box_around(components.point);
  const auto undone = [](const Extract& extract) { return !extract.done; };
  join_boxes(extracts);
  for (auto next = extracts.begin(); next != extracts.end();) {
    if (Status status = extract_hanging(components, met, reach, all, *next); !status) return status;
    if (!next->done) join_boxes(extracts);
    next = std::ranges::find_if(extracts, undone);
  }
  for (const Extract& extract : extracts) out.append(extract.hanging);
  return {};
}

}  // namespace

std::int64_t overhang_reach(double distance, double angle_deg) {
  return std::llround(distance * std::tan(angle_deg * std::numbers::pi / 180));
}

LayerOverhang measure_overhang(const ContoursView& contours) {
  LayerOverhang facts;
  facts.area_mm2 = square_mm(doubled_area(contours));
  struct Piece {
    std::uint32_t begin, end;
    double area_mm2;
  };
  std::vector<Piece> pieces;
  for (std::uint32_t begin = 0, end = 0; begin < contours.size(); begin = end) {
    end = component_end(contours, begin);
    __int128 doubled = 0;
    for (std::uint32_t c = begin; c < end; ++c) doubled += doubled_area(contours[c]);
    pieces.push_back({begin, end, square_mm(doubled)});
  }
  const std::size_t count = std::min(pieces.size(), LayerOverhang::kMaxSpots);
  std::ranges::partial_sort(pieces, pieces.begin() + static_cast<std::ptrdiff_t>(count), [](const Piece& a, const Piece& b) {
    return std::pair(b.area_mm2, a.begin) < std::pair(a.area_mm2, b.begin);
  });
  pieces.resize(count);
  Buffer<std::uint32_t> rebased;
  for (const Piece& piece : pieces) {
    const ContoursView component = range_of(contours, piece.begin, piece.end, rebased);
    const PlanarBox box = box_around(component[0]);
    facts.spots.push_back({piece.area_mm2, point_within(component), box.lo, box.hi});
  }
  return facts;
}

Result<Contours> find_overhangs(const ContoursView& own, const ContoursView& below, std::int64_t reach, RegionBelow& scratch) {
  Contours region;
  if (own.size() == 0 || (std::ranges::equal(own.offset, below.offset) && std::ranges::equal(own.point, below.point)))
    return region;
  if (below.size() == 0) {
    region.append(own);
  } else {
    if (Status status = scratch.prepare(below, own, certain(reach) - 1); !status) return status.error();
    Buffer<std::uint32_t> rebased;
    Contours candidates;
    std::vector<PlanarBox> uncarried;
    for (std::uint32_t begin = 0, end = 0; begin < own.size(); begin = end) {
      end = component_end(own, begin);
      const ContoursView component = range_of(own, begin, end, rebased);
      const bool shares = shares_area(component, scratch);
      const std::size_t before = uncarried.size();
      find_uncarried(component, scratch, certain(reach) - 1, uncarried);
      if (shares && uncarried.size() == before) continue;
      const Result<bool> separate = shares ? Result<bool>(false) : is_separate(component, scratch);
      if (!separate) return separate.error();
      (*separate ? region : candidates).append(component);
      if (*separate) uncarried.resize(before);
    }
    if (Status status = append_hanging(candidates, scratch, reach, uncarried, region); !status) return status.error();
  }
  return region;
}

}  // namespace lamina::checks
