// stages/data/grid.h: the pixel centres of a bed, as integers, and where a print head passes and stands over them.
#pragma once

#include <cmath>
#include <cstdint>
#include <numeric>

#include "stages/data/units.h"

namespace lamina {

/// Digits after the point that dpi may have: products of dots and nm stay below 2^63.
inline constexpr std::uint32_t kDpiDigits = 4;
inline constexpr std::int64_t kDpiUnit = 10'000, kMaxDpi = 25'400;
inline constexpr std::int64_t kMaxDots = kMaxDpi * kDpiUnit, kMaxSpan = 1'000'000'000'000;

/// Whole dots in a span of nm.
struct DotPitch {
  std::int64_t dots = 0, span = kNmPerInch;
  bool operator==(const DotPitch&) const = default;
  constexpr double nm() const { return static_cast<double>(span) / static_cast<double>(dots); }
};

/// dpi to kDpiDigits digits as the fraction that they are, in lowest terms: dots in the span of an inch if they are whole.
/// dpi  1 .. kMaxDpi
inline DotPitch pitch_of_dpi(double dpi) {
  const std::int64_t units = std::llround(dpi * kDpiUnit), common = std::gcd(units, kDpiUnit);
  return {units / common, kNmPerInch * (kDpiUnit / common)};
}
/// Whether dpi have at most kDpiDigits digits after the point.
inline bool is_exact_dpi(double dpi) { return static_cast<double>(std::llround(dpi * kDpiUnit)) / kDpiUnit == dpi; }

/// Pixel centres along one side of the bed. Centre i lies at floor((2 i + 1) * span / (2 dots)) nm from the origin of
/// the bed; the last pixel may reach past the bed's edge. Whole dpi are dots in the span of an inch, decimal ones in that of
/// several; the grid of a tilted head is 1000 dots in a span of 1000 pixels (so that its pitch is whole picometres).
struct PixelAxis {
  std::int64_t dots = 0;           // 1 .. kMaxDots
  std::int64_t length = 0;         // nm, bed side, 1 .. kNmReach
  std::int64_t span = kNmPerInch;  // nm that hold `dots` pixels, 1 .. kMaxSpan; a pixel is at least 1000 nm
  std::uint32_t count = 0;         // ceil(length * dots / span)

  PixelAxis() = default;
  PixelAxis(std::int64_t dots_in_span, std::int64_t length_nm, std::int64_t span_nm = kNmPerInch)
      : dots(dots_in_span),
        length(length_nm),
        span(span_nm),
        count(static_cast<std::uint32_t>(ceil_div(length_nm * dots_in_span, span_nm))) {}

  PixelAxis(const DotPitch& pitch, std::int64_t length_nm) : PixelAxis(pitch.dots, length_nm, pitch.span) {}

  constexpr DotPitch pitch() const { return {dots, span}; }
  /// For reports, tags and first guesses; the nearest double to the dpi.
  constexpr double dpi() const { return static_cast<double>(dots) * kNmPerInch / static_cast<double>(span); }
  constexpr double pixels_per_nm() const { return static_cast<double>(dots) / static_cast<double>(span); }

  /// nm of the centre of pixel i.
  constexpr std::int64_t centre(std::int64_t i) const { return (2 * i + 1) * span / (2 * dots); }

  /// The first pixel whose centre is at or beyond `nm` (not clamped to 0 .. count).
  /// floor(q) >= nm is q >= nm for a whole nm, so no rounding enters.
  constexpr std::int64_t first_at_or_beyond(std::int64_t nm) const { return ceil_div(nm * 2 * dots - span, 2 * span); }
};

/// The image of a bed. Columns count from the left edge. Geometry rows count from the front edge (smallest y);
/// image rows from the back edge, so image row r is geometry row rows - 1 - r.
struct PixelGrid {
  PixelAxis x, y;
  std::uint32_t columns() const { return x.count; }
  std::uint32_t rows() const { return y.count; }
};

/// What a sweep of the head passes over: pixels [left, right) x [top, bottom) of the image.
struct SwathBand {
  double left, right, top, bottom;
  bool present;  // the one under inspection
};

/// A nozzle at a step.
struct NozzlePosition {
  double column, row;  // of its centre, in pixels
  bool fires;
};

}  // namespace lamina
