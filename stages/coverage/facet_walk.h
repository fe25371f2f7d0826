// stages/coverage/facet_walk.h: a facet from row to row, from the back of the bed to its front.
//
// Two corners of its border lead from the highest y downwards, one in the order of the corners and one against it. Between two
// rows stands the chord from one to the other, which both rows share; a row without a corner in it is made of two chords.
#pragma once

#include <cstdint>

#include "stages/coverage/row_tents.h"
#include "stages/coverage/slab_facet.h"

namespace lamina::cover {

/// The ends of what a plane of one y cuts out: on the border in the order of corners, and against it. From the lowest corner.
struct Chord {
  double x_on, z_on, x_back, z_back;
  double height() const { return z_back - z_on; }
};

class FacetWalk {
 public:
  void start(const SlabFacet& facet);

  /// To the next row, which lies below the one before it. low, high: its edges, nm from the facet's lowest corner.
  void step(const SlabFacet& facet, double low, double high) {
    if (begun_ && low >= stop_) {
      above_ = below_;
      below_ = chord(low);
      plain_ = true;
      first = std::min(std::min(above_.x_on, above_.x_back), std::min(below_.x_on, below_.x_back));
      last = std::max(std::max(above_.x_on, above_.x_back), std::max(below_.x_on, below_.x_back));
      area = (above_.height() + below_.height()) * (high - low) * 0.5;
      return;
    }
    step_over_corners(facet, low, high);
  }

  /// The row's piece; x from the lowest corner.
  void cut_out(const SlabFacet& facet, double low, double high, Tents& piece) const;

  double first, last;  // x that the row's piece reaches
  double area;         // of it, seen along x: positive where +x goes into the solid

 private:
  struct Side {
    double y, x, z, dx, dz;  // a point, and what a step along y adds
    double end;              // y of the next corner
    std::uint32_t to;        // that corner
  };

  Chord chord(double y) const {
    const double on = y - on_.y, back = y - back_.y;
    return {on_.x + on * on_.dx, on_.z + on * on_.dz, back_.x + back * back_.dx, back_.z + back * back_.dz};
  }
  void take_edge(const SlabFacet& facet, Side& side, std::uint32_t next);
  bool turn(const SlabFacet& facet);
  void step_over_corners(const SlabFacet& facet, double low, double high);
  void reach(const Chord& chord);

  Side on_, back_;
  double top_, stop_;  // y of the highest corner, and of the next one
  Chord above_, below_;
  std::uint32_t edges_;  // taken so far
  bool begun_, ended_, plain_;
};

}  // namespace lamina::cover
