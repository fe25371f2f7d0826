// stages/geometry/contours/components.h: the connected parts of a region, as ranges of its contours.
#pragma once

#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"

namespace lamina {

// --- contours: each outer one is followed by the holes in it

/// One past the holes of the outer contour at `begin`. cost  O(P) of them
inline std::uint32_t component_end(const ContoursView& contours, std::uint32_t begin) {
  std::uint32_t end = begin + 1;
  while (end < contours.size() && doubled_area(contours[end]) < 0) ++end;
  return end;
}

/// Calls use(begin, end) for each outer contour with its holes.
template <class Use>
void for_each_component(const ContoursView& contours, Use use) {
  for (std::uint32_t begin = 0, end = 0; begin < contours.size(); begin = end) {
    end = component_end(contours, begin);
    use(begin, end);
  }
}

/// The contours [begin, end). rebased  receives their offsets, and must outlive the view
inline ContoursView range_of(const ContoursView& contours, std::uint32_t begin, std::uint32_t end,
                             Buffer<std::uint32_t>& rebased) {
  rebased.clear();
  for (std::uint32_t c = begin; c <= end; ++c) rebased.push_back(contours.offset[c] - contours.offset[begin]);
  return {rebased, contours.point.subspan(contours.offset[begin], contours.offset[end] - contours.offset[begin])};
}

}  // namespace lamina
