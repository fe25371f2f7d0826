// stages/data/grid.h: the pixel centres of a bed, as integers.
#pragma once

#include <cstdint>

#include "stages/data/units.h"

namespace lamina {

/// Pixel centres along one side of the bed. Centre i lies at floor((2 i + 1) * 25400000 / (2 dpi)) nm from the
/// origin of the bed; the last pixel may reach past the bed's edge.
struct PixelAxis {
  std::int64_t dpi = 0;      // 1 .. 25400
  std::int64_t length = 0;   // nm, bed side, 1 .. kNmReach
  std::uint32_t count = 0;   // ceil(length * dpi / 25400000)

  PixelAxis() = default;
  PixelAxis(std::int64_t dots_per_inch, std::int64_t length_nm)
      : dpi(dots_per_inch),
        length(length_nm),
        count(static_cast<std::uint32_t>(ceil_div(length_nm * dots_per_inch, kNmPerInch))) {}

  /// nm of the centre of pixel i.
  constexpr std::int64_t centre(std::int64_t i) const { return (2 * i + 1) * kNmPerInch / (2 * dpi); }

  /// The first pixel whose centre is at or beyond `nm` (not clamped to 0 .. count).
  /// floor(q) >= nm is q >= nm for a whole nm, so no rounding enters.
  constexpr std::int64_t first_at_or_beyond(std::int64_t nm) const {
    return ceil_div(nm * 2 * dpi - kNmPerInch, 2 * kNmPerInch);
  }
};

/// The image of a bed. Columns count from the left edge. Geometry rows count from the front edge (smallest y);
/// image rows from the back edge, so image row r is geometry row rows - 1 - r.
struct PixelGrid {
  PixelAxis x, y;
  std::uint32_t columns() const { return x.count; }
  std::uint32_t rows() const { return y.count; }
};

}  // namespace lamina
