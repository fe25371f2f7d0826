// stages/geometry/travel/inside_route.h: travels that stay inside of a layer's contours: around holes and notches instead of
// across. As "avoid crossing perimeters" of PrusaSlicer (GCode/AvoidCrossingPerimeters.cpp): where the straight line leaves a
// contour, it follows that contour to where it enters it last, and then cuts corners.
#pragma once

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/geometry/travel/edge_grid.h"

namespace lamina::travel {

/// Finds routes in one region; scratch is reused from route to route. One thread at a time.
class InsideRoute {
 public:
  /// region      must outlive this object
  /// inset       nm from the contours at which routes follow them
  /// detour_nm   max. length in addition to the straight line; 0: straight lines only
  InsideRoute(const EdgeGrid& region, Nm inset, double detour_nm) : region_(&region), inset_(inset), detour_(detour_nm) {}

  /// The points of a route after `a`; the last one is `b`. Empty if none was found: no line of a route touches a contour.
  /// Valid until the next call.
  const Buffer<Point2>& find(Point2 a, Point2 b);

 private:
  bool follow_contours(Point2 a, Point2 b);
  bool follow(std::uint32_t leaves, Point2 from, std::uint32_t enters, Point2 to);
  bool cut_corners();
  void add_inset(Point2 at, std::uint32_t edge, std::uint32_t other);

  const EdgeGrid* region_;
  Nm inset_;
  double detour_;
  Buffer<EdgeGrid::EdgeCrossing> crossing_;
  Buffer<Point2> long_way_, route_;
};

}  // namespace lamina::travel
