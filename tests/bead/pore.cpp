// tests/bead/pore.cpp: the gap along a period, from the middle of the thin stretch to both sides.
#include "tests/bead/pore.h"

#include <algorithm>
#include <cstddef>

#include "stages/data/buffer.h"

namespace lamina::bead {
namespace {

/// mm that a straight piece stays at or above a level from the end at which it has `first` on; all of it: the piece's length.
double stays_above(double level, double first, double last, double length) {
  if (first < level) return 0;
  return last >= level ? length : length * (first - level) / (first - last);
}

/// Around a place, without end to both sides: mm where the gap is at least `level`, at most a period.
double length_above(const Buffer<ProfilePiece>& gaps, std::size_t middle, double position, double level) {
  double length = 0;
  for (const bool forwards : {true, false}) {
    for (std::size_t n = 0; n < gaps.size(); ++n) {
      const std::size_t i = (forwards ? middle + n : middle + gaps.size() - n) % gaps.size();
      const ProfilePiece& p = gaps[i];
      const double from = n == 0 ? position : forwards ? p.begin_mm : p.end_mm, to = forwards ? p.end_mm : p.begin_mm;
      if (from == to) continue;
      const double whole = forwards ? to - from : from - to,
                   above = stays_above(level, p.width_at(from), p.width_at(to), whole);
      length += above;
      if (above < whole) break;
    }
  }
  return std::min(length, gaps.back().end_mm);
}

}  // namespace

BeadPore adjacent_pore(const BeadMachine& machine, double height_mm, const Pattern& pattern, double spacing_mm,
                       double adjacent_mm, double bond_gap_mm, bool spread) {
  const double middle = pattern.thick_mm + pattern.thin_mm / 2;
  Buffer<ProfilePiece> gaps;  // widths of the gap
  std::size_t at = 0;
  double widest = 0;
  steady_profile(machine, height_mm, pattern, spread, [&](const ProfilePiece& p) {
    const double begin = spacing_mm - (p.begin_width_mm + adjacent_mm) / 2,
                 end = spacing_mm - (p.end_width_mm + adjacent_mm) / 2;
    if (p.begin_mm <= middle) at = gaps.size();
    widest = std::max({widest, begin, end});
    gaps.push_back({p.begin_mm, p.end_mm, begin, end});
  });
  if (gaps.empty()) return {};
  const double width = gaps[at].width_at(middle);
  if (width <= 0) return {width, widest, 0, 0};
  return {width, widest, length_above(gaps, at, middle, width / 2), length_above(gaps, at, middle, std::max(bond_gap_mm, 0.0))};
}

}  // namespace lamina::bead
