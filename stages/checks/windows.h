// stages/checks/windows.h: minima of numbers in sliding windows, of powers of two elements, doubled, in vector registers.
//
// Source: M. van Herk, Pattern Recognition Letters 13(7), 1992, section 1; sums of segments, P. Soille, Morphological Image
// Analysis, 2nd ed., Springer 2003, chapter 3.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "stages/data/buffer.h"

namespace lamina::checks {

/// Steps of a stencil in each direction from its first pixel: it is the sum of these four segments (thin.h).
struct StencilSteps {
  std::uint32_t right = 0, down = 0, falling = 0, rising = 0;
  std::uint32_t columns() const { return 1 + right + falling + rising; }
  std::uint32_t rows() const { return 1 + down + falling + rising; }
};

/// Minima of values in a sliding window, each with what the window adds to it; several windows one after the other.
struct Windows {
  struct WindowStep {
    std::uint32_t further;
    std::int32_t more;
  };
  std::array<WindowStep, 96> step;
  std::uint32_t steps = 0, reach = 0;
  std::int32_t added = 0;  // to all values

  /// A window of `count` more elements with `slope` more for each.
  void add(std::uint32_t count, std::int32_t slope) {
    for (std::uint32_t window = 1; window < count + 1;) {
      const std::uint32_t further = std::min(window, count + 1 - window);
      step[steps++] = {further, slope * static_cast<std::int32_t>(further)};
      window += further;
    }
    reach += count;
  }
};

/// The left ends of a stencil's rows from the first one on, or from the last one back.
Windows profile(const StencilSteps& stencil, bool from_first);

/// The minimum of each of `count` windows that begin one element after the other. values  windows.reach more than `count`
/// sign  1, or -1: of their negatives. held  scratch
/// cost  a few tenths of a nanosecond an element for each doubling
void slide_minima(const std::int32_t* values, std::size_t count, std::int32_t sign, const Windows& windows,
                  Buffer<std::int32_t>& held, std::int32_t* result);

}  // namespace lamina::checks
