// stages/data/fill_rule.h: which winding numbers are solid.
#pragma once

#include <cstdint>

namespace lamina {

/// Applied to the winding number of all facets together about a point.
enum class FillRule : std::uint8_t {
  kNonzero,   // not zero: the union of overlapping shells; a shell turned inside out is still solid
  kPositive,  // above zero: a shell turned inside out is empty
  kEvenOdd    // odd: what lies in two shells is a hole
};

constexpr bool is_solid(FillRule rule, std::int32_t winding) {
  switch (rule) {
    case FillRule::kPositive: return winding > 0;
    case FillRule::kEvenOdd: return (winding & 1) != 0;
    case FillRule::kNonzero: break;
  }
  return winding != 0;
}

}  // namespace lamina
