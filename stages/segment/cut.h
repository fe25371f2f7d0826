// stages/segment/cut.h: one line -> thick and thin stretches, one at a time.
//
// A thick stretch is wide enough to touch the neighbouring lines; a thin one leaves a pore. Where a line is cut follows
// Fukuda, Volpato and Di Nisio, "Algoritmo para preenchimento poroso em impressão 3D através de deposição segmentada"
// (2020), and Di Nisio, "Estratégia de deposição com variação de largura do filamento para geração de estruturas porosas
// com manufatura aditiva por extrusão de material" (2022), section 3.1.1. The two rules differ; both are here, and a
// third one that keeps what each of them promises.
#pragma once

#include <algorithm>
#include <cstdint>

#include "stages/data/choices.h"
#include "stages/data/toolpaths.h"
#include "stages/data/units.h"
#include "stages/segment/settings.h"

namespace lamina::segment {

/// How the lines of a layer are cut. nm along the lines.
struct LineCut {
  CutRule rule = CutRule::kAligned;
  std::int64_t thin = 1'500'000, thick = 1'500'000;  // > 0
  std::int64_t origin = 0;                           // where a thin stretch of the grid begins; any of them
  std::int64_t min_end = 0;                          // no thin stretch is nearer to the end of a line; not used by kGrid

  /// The same cuts for lines that are walked the other way, in coordinates with the sign changed.
  LineCut mirrored() const {
    LineCut other = *this;
    other.origin = -(origin + thin);
    return other;
  }
};

/// Calls visit(begin, end, Thickness) for the stretches of the line [from, to], in order; they cover it without a gap
/// and none is empty. Neighbouring stretches differ. A line without a thin stretch is one stretch: reference where
/// the grid does not divide it (as published), thick under the other rules, so that it still touches its neighbours,
/// which are spaced for thick stretches.
/// cost  O(stretches), no memory
template <class Visit>
void cut_line(const LineCut& cut, std::int64_t from, std::int64_t to, Visit&& visit) {
  if (to <= from) return;
  const std::int64_t period = cut.thin + cut.thick;
  if (cut.rule == CutRule::kGrid) {
    std::int64_t mark = cut.origin + floor_div(from - cut.origin, period) * period + cut.thin;
    bool thin = true;
    if (mark < from) {
      mark += cut.thick;
      thin = false;
    }
    if (mark > to) return visit(from, to, Thickness::kReference);
    std::int64_t begin = from;
    while (mark < to) {
      if (mark > begin) visit(begin, mark, thin ? Thickness::kThin : Thickness::kThick);
      begin = mark;
      thin = !thin;
      mark += thin ? cut.thin : cut.thick;
    }
    return visit(begin, to, thin ? Thickness::kThin : Thickness::kThick);
  }
  std::int64_t next;  // where the first thin stretch begins
  std::int64_t last;  // where it may begin at the latest
  if (cut.rule == CutRule::kThickEnds) {
    const std::int64_t end = std::max<std::int64_t>(cut.min_end, 1);
    const std::int64_t available = to - from - 2 * end + cut.thick;
    const std::int64_t count = available < period ? 0 : available / period;
    if (count == 0) return visit(from, to, Thickness::kThick);
    next = from + (to - from - count * period + cut.thick) / 2;
    last = next + (count - 1) * period;
  } else {
    const std::int64_t end = std::max<std::int64_t>(cut.min_end, 1);
    next = cut.origin + ceil_div(from + end - cut.origin, period) * period;
    last = to - end - cut.thin;
    if (next > last) return visit(from, to, Thickness::kThick);
  }
  std::int64_t begin = from;
  for (; next <= last; next += period) {
    visit(begin, next, Thickness::kThick);
    visit(next, next + cut.thin, Thickness::kThin);
    begin = next + cut.thin;
  }
  visit(begin, to, Thickness::kThick);
}

}  // namespace lamina::segment
