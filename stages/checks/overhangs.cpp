#include "stages/checks/overhangs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "stages/geometry/clipping.h"

namespace lamina::checks {
namespace {

constexpr std::int64_t kRounding = 4;  // nm: points of both sections, the reach, and edges of its offset

/// The reach less what rounding may add to the growth of a face, but more than that of vertical walls.
std::int64_t certain(std::int64_t reach) { return std::max(reach - kRounding, kRounding); }

/// The contours [begin, end) of all.
ContoursView part_of(const ContoursView& all, std::uint32_t begin, std::uint32_t end, Buffer<std::uint32_t>& rebased) {
  rebased.clear();
  for (std::uint32_t c = begin; c <= end; ++c) rebased.push_back(all.offset[c] - all.offset[begin]);
  return {rebased, all.point.subspan(all.offset[begin], all.offset[end] - all.offset[begin])};
}

/// One past the holes of the outer contour at `begin`.
std::uint32_t end_of_component(const ContoursView& all, std::uint32_t begin) {
  std::uint32_t end = begin + 1;
  while (end < all.size() && doubled_area(all[end]) < 0) ++end;
  return end;
}

/// The contours below that a component can meet once they grow.
Contours below_component(const ContoursView& component, const RegionBelow& below, std::int64_t reach) {
  const PlanarBox around = box_around(component[0]);
  Contours met;
  for (std::uint32_t c = 0; c < below.contours.size(); ++c) {
    if (!below.box[c].meets(around, 2 * reach + kRounding)) continue;
    met.point.insert(met.point.end(), below.contours[c].begin(), below.contours[c].end());
    met.close();
  }
  return met;
}

/// Appends what hangs of a component. shares  whether it certainly shares area with the region below
Status append_hanging(const ContoursView& component, const RegionBelow& below, std::int64_t reach, bool shares, Contours& out) {
  const Contours met = below_component(component, below, reach);
  if (!shares) {
    const auto fresh = subtract_contours(component, met, false);
    if (!fresh) return fresh.error();
    if (doubled_area(*fresh) == doubled_area(component)) {
      out.append(component);
      return {};
    }
  }
  const auto carrying = offset_contours(met, certain(reach));
  if (!carrying) return carrying.error();
  const auto far = subtract_contours(component, *carrying, false);
  if (!far) return far.error();
  if (far->size() == 0) return {};
  const auto around = offset_contours(*far, reach + 2 * kRounding);
  if (!around) return around.error();
  // In this order only edges that are next to what hangs are compared with those below, which they may nearly coincide with.
  const auto near = intersect_contours(component, *around, false);
  if (!near) return near.error();
  const auto hanging = subtract_contours(*near, met, false);
  if (!hanging) return hanging.error();
  out.append(*hanging);
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
    end = end_of_component(contours, begin);
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
    const ContoursView component = part_of(contours, piece.begin, piece.end, rebased);
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
    for (std::uint32_t begin = 0, end = 0; begin < own.size(); begin = end) {
      end = end_of_component(own, begin);
      const ContoursView component = part_of(own, begin, end, rebased);
      const bool shares = shares_area(component, scratch);
      if (shares && is_carried(component, scratch, certain(reach) - 1)) continue;
      if (Status status = append_hanging(component, scratch, reach, shares, region); !status) return status.error();
    }
  }
  return region;
}

}  // namespace lamina::checks
