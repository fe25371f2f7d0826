#include "stages/coverage/facet_walk.h"

#include <algorithm>

namespace lamina::cover {

void FacetWalk::take_edge(const SlabFacet& facet, Side& side, std::uint32_t next) {
  const std::uint32_t from = side.to;
  const double fall = facet.y[from] - facet.y[next];
  side.y = facet.y[from];
  side.x = facet.x[from];
  side.z = facet.z[from];
  side.to = next;
  side.end = std::min(facet.y[next], side.y);
  side.dx = side.dz = 0;
  if (fall > 0) {
    side.dx = (side.x - facet.x[next]) / fall;
    side.dz = (side.z - facet.z[next]) / fall;
  }
  ++edges_;
}

void FacetWalk::start(const SlabFacet& facet) {
  std::uint32_t highest = 0;
  for (std::uint32_t i = 1; i < facet.corners; ++i) {
    if (facet.y[i] > facet.y[highest]) highest = i;
  }
  top_ = facet.y[highest];
  edges_ = 0;
  on_.to = back_.to = highest;
  take_edge(facet, on_, highest + 1 == facet.corners ? 0 : highest + 1);
  take_edge(facet, back_, highest == 0 ? facet.corners - 1 : highest - 1);
  stop_ = std::max(on_.end, back_.end);
  begun_ = ended_ = plain_ = false;
}

void FacetWalk::reach(const Chord& chord) {
  first = std::min(first, std::min(chord.x_on, chord.x_back));
  last = std::max(last, std::max(chord.x_on, chord.x_back));
}

/// Beyond the corner at stop_; false if it was the last.
bool FacetWalk::turn(const SlabFacet& facet) {
  const bool is_on = on_.end >= back_.end;
  if (edges_ >= facet.corners) return false;
  Side& side = is_on ? on_ : back_;
  const std::uint32_t last_corner = facet.corners - 1;
  if (is_on) {
    take_edge(facet, side, side.to == last_corner ? 0 : side.to + 1);
  } else {
    take_edge(facet, side, side.to == 0 ? last_corner : side.to - 1);
  }
  side.y = std::min(side.y, stop_);
  side.end = std::min(side.end, stop_);
  stop_ = std::max(on_.end, back_.end);
  return true;
}

void FacetWalk::step_over_corners(const SlabFacet& facet, double low, double high) {
  plain_ = false;
  area = 0;
  first = 0;
  last = facet.size;
  if (ended_ || (!begun_ && top_ <= low)) return;  // rounding has left nothing here: the row holds the facet all the same
  double y = begun_ ? high : top_;
  Chord at = begun_ ? below_ : chord(top_);
  first = last = at.x_on;
  reach(at);
  while (stop_ > low) {
    Chord next = chord(stop_);
    reach(next);
    area += (at.height() + next.height()) * (y - stop_) * 0.5;
    y = stop_;
    if (!turn(facet)) {
      ended_ = begun_ = true;
      reach({facet.x[on_.to], 0, facet.x[back_.to], 0});  // where the last edge lies along the row
      return;
    }
    at = chord(y);
    reach(at);
  }
  begun_ = true;
  below_ = chord(low);
  reach(below_);
  area += (at.height() + below_.height()) * (y - low) * 0.5;
}

void FacetWalk::cut_out(const SlabFacet& facet, double low, double high, Tents& piece) const {
  if (!plain_) return piece.cut_out(facet, low, high);
  piece.count = facet.edgewise ? 0 : 1;
  const double half = (high - low) * 0.5;
  piece.pair[0] = TentPair(Two{above_.x_back, below_.x_back}, Two{above_.x_on, below_.x_on}, Two{below_.x_back, above_.x_on},
                           Two{above_.height() * half, below_.height() * half});
}

}  // namespace lamina::cover
