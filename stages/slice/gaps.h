// stages/slice/gaps.h: open chains of a mesh that is not closed, joined over short gaps.
#pragma once

#include <algorithm>
#include <cstdint>

#include "stages/data/contours.h"

namespace lamina::slice {

struct GapReport {
  std::uint32_t closed = 0;         // gaps that were bridged
  std::int64_t largest_closed = 0;  // nm, the longest bridge, rounded up
  std::uint32_t open = 0;           // chains that stay open
  Point2 first_open{};              // start of the first of these

  void add(const GapReport& other) {
    if (open == 0) first_open = other.first_open;
    closed += other.closed;
    largest_closed = std::max(largest_closed, other.largest_closed);
    open += other.open;
  }
};

/// Joins ends of chains to starts of chains that are at most `most` nm away by a straight stretch, shortest first
/// (then by the chains' order); every end and start once. What has become a loop goes to `closed`; what has not stays
/// in `open`, joined.
/// cost  O(K log K) for K chains as a rule
GapReport close_gaps(Contours& open, Nm maximum, Contours& closed);

}  // namespace lamina::slice
