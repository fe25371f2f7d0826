// stages/geometry/contours/monotone.h: contacts between contours that wind smoothly, found by halving.
//
// A stretch of a contour along which x and y never turn back (a monotone chain) meets itself nowhere, and the box of any
// part of it is that of the part's two ends. So two chains are compared by halving them where their boxes meet, and what
// lies apart is done with at once. A smooth contour has a few chains, whatever the number of its points.
#pragma once

#include <cstdint>
#include <utility>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"

namespace lamina {

struct MonotoneChain {
  std::uint32_t contour, begin, edges;  // from point `begin` of all on, wrapping at the contour's end
  Point2 lo, hi;
};

struct MonotoneScratch {
  Buffer<MonotoneChain> chain;
  Buffer<std::uint32_t> open;
  Buffer<std::pair<std::uint32_t, std::uint32_t>> contact;  // contours, one with itself too; some may come more than once

  std::uint64_t bytes() const { return bytes_held(chain) + bytes_held(open) + bytes_held(contact); }
};

/// Leaves in scratch.contact enough of the pairs of contours in contact (contact.h says what that is) to join every
/// group of them.
///
/// returns  false if the contours wind so much, or lie so close, that a grid is better; what is found then is void
/// cost     O(P) for P points, else gives up after a few comparisons a point
bool find_monotone_contacts(const ContoursView& contours, MonotoneScratch& scratch);

}  // namespace lamina
