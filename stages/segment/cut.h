// stages/segment/cut.h: the lines of a layer -> thick and thin segments, one at a time, while they are written or drawn.
//
// A thick segment is wide enough to touch the neighbouring lines; a thin one leaves a pore. Where a line is cut follows
// Fukuda, Volpato and Di Nisio, "Algoritmo para preenchimento poroso em impressão 3D através de deposição segmentada"
// (2020), and Di Nisio, "Estratégia de deposição com variação de largura do filamento para geração de estruturas porosas
// com manufatura aditiva por extrusão de material" (2022), section 3.1.1. The two rules differ; both are here, and a
// third one that keeps what each of them promises.
//
// The plain filling is what is stored. Nothing here keeps a list: every stretch is handed to the caller and forgotten,
// so a segmented job needs the memory of the plain one (Fukuda et al. 2020: "lazy evaluation").
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>

#include "stages/data/choices.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/data/units.h"
#include "stages/segment/segmentation.h"

namespace lamina::segment {

/// How the lines of a layer are cut. nm along the lines.
struct LineCut {
  CutRule rule = CutRule::kAligned;
  std::int64_t thin = 1'500'000, thick = 1'500'000;  // > 0
  std::int64_t origin = 0;                           // where a thin segment of the grid begins; any of them
  std::int64_t min_end = 0;                          // no thin segment is nearer to the end of a line; not used by kGrid

  /// The same cuts for lines that are walked the other way, in coordinates with the sign changed.
  LineCut mirrored() const {
    LineCut other = *this;
    other.origin = -(origin + thin);
    return other;
  }
};

/// Calls visit(begin, end, Thickness) for the segments of the line [from, to], in order; they cover it without a gap
/// and none is empty. Neighbouring stretches differ. A line without a thin segment is one stretch: reference where
/// the grid does not divide it (as published), thick under the other rules, so that it still touches its neighbours,
/// which are spaced for thick segments.
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
  const std::int64_t end = std::max<std::int64_t>(cut.min_end, 1);
  std::int64_t next;  // where the first thin segment begins
  std::int64_t last;  // where it may begin at the latest
  if (cut.rule == CutRule::kThickEnds) {
    const std::int64_t available = to - from - 2 * end + cut.thick;
    const std::int64_t count = available < period ? 0 : available / period;
    if (count == 0) return visit(from, to, Thickness::kThick);
    next = from + (to - from - count * period + cut.thick) / 2;
    last = next + (count - 1) * period;
  } else {
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

/// Which lines of a layer are segmented, and how.
struct LayerCut {
  bool on = false;
  LineCut line;
  double along_x = 1, along_y = 0;  // unit vector of the lines, within half a turn: layers 180 degrees apart agree
  std::uint32_t continuous = 1;     // lines between two segmented ones
  std::int32_t first = 0;           // number of a segmented line
  std::int64_t shift = 0;           // nm: closed curves begin so much further along than they are stored
  bool one_direction = true;        // segmented lines are all deposited the same way; needs a travel where a zigzag comes back

  bool segments(PathKind kind, std::int32_t number) const {
    if (!on || number == kNoLine || (kind != PathKind::kRaster && kind != PathKind::kContour)) return false;
    return (std::int64_t{number} - first) % (std::int64_t{continuous} + 1) == 0;
  }
  /// Which of the segmented lines a line is, from 0 for `first`.
  std::int64_t ordinal(std::int32_t number) const {
    return floor_div(std::int64_t{number} - first, std::int64_t{continuous} + 1);
  }
};

namespace expand_detail {

/// The point `at` of [from, to] along a straight line from a to b.
inline Point2 between(Point2 a, Point2 b, std::int64_t from, std::int64_t to, std::int64_t at) {
  const double share = static_cast<double>(at - from) / static_cast<double>(to - from);
  return {static_cast<Nm>(a.x + std::llround(share * (static_cast<double>(b.x) - a.x))),
          static_cast<Nm>(a.y + std::llround(share * (static_cast<double>(b.y) - a.y)))};
}

inline double distance(Point2 a, Point2 b) {
  return std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
}

}  // namespace expand_detail

/// Calls visit(const PathInterval&) for every interval of a layer, in the order of deposition.
///
/// Straight lines are cut by their position along `along`, so that pores of all lines and layers are on one grid. Lines of
/// several points and closed curves are cut by their length. A closed curve comes to whole periods under every rule: its
/// thick segments are made as much longer as that needs, and it begins and ends in the middle of one.
/// cost  O(points + stretches), no memory
template <class Visit>
class Expander {
 public:
  Expander(const ToolpathsView& paths, const LayerCut& cut, Visit& visit) : paths_(paths), cut_(cut), visit_(visit) {}

  void run() {
    for (std::uint32_t p = 0; p < paths_.size(); ++p) path(paths_.offset[p], paths_.offset[p + 1] - 1);
  }

 private:
  void path(std::uint32_t first, std::uint32_t last) {
    jump_ = true;
    std::uint32_t i = first;
    while (i < last) {
      // --- a run of stretches of one kind and line
      std::uint32_t end = i + 1;
      while (end < last && paths_.kind[end] == paths_.kind[i] && paths_.line[end] == paths_.line[i]) ++end;
      if (!cut_.on || !cut_.segments(paths_.kind[i], paths_.line[i])) {
        const bool link = cut_.on && paths_.kind[i] == PathKind::kLink;
        if (link && (turned_before_ || (end < last && is_turned(end, last)))) {
          jump_ = true;  // the link led to where a turned line ends, or away from where it began
        } else {
          for (std::uint32_t k = i; k < end; ++k) give(paths_.point[k], paths_.point[k + 1], i, Thickness::kReference);
        }
        turned_before_ = false;
      } else if (end == i + 1) {
        line(i);
      } else {
        curve(i, end, first == i && end == last && paths_.point[first] == paths_.point[last]);
      }
      i = end;
    }
    turned_before_ = false;
  }

  std::int64_t along(Point2 p) const {
    return std::llround(cut_.along_x * static_cast<double>(p.x) + cut_.along_y * static_cast<double>(p.y));
  }

  /// Whether the run that starts at i is a segmented straight line that is deposited the other way round than it is stored.
  bool is_turned(std::uint32_t i, std::uint32_t last) const {
    if (!cut_.one_direction || !cut_.segments(paths_.kind[i], paths_.line[i]) || i + 1 > last) return false;
    const bool lone = i + 1 == last || paths_.kind[i + 1] != paths_.kind[i] || paths_.line[i + 1] != paths_.line[i];
    return lone && paths_.kind[i] == PathKind::kRaster && is_odd(paths_.line[i]) != is_odd(cut_.first);
  }
  static bool is_odd(std::int32_t number) { return (number & 1) != 0; }

  void line(std::uint32_t i) {
    Point2 a = paths_.point[i], b = paths_.point[i + 1];
    const bool turned = is_turned(i, i + 1);
    if (turned) {
      std::swap(a, b);
      jump_ = true;
    }
    std::int64_t from = along(a), to = along(b);
    const bool back = to < from;
    if (back) {
      from = -from;
      to = -to;
    }
    if (from == to) {
      give(a, b, i, Thickness::kReference);  // across the grid: nothing to cut along
    } else {
      const LineCut mirrored = back ? cut_.line.mirrored() : cut_.line;
      cut_line(mirrored, from, to, [&](std::int64_t begin, std::int64_t end, Thickness thickness) {
        give(begin == from ? a : expand_detail::between(a, b, from, to, begin),
             end == to ? b : expand_detail::between(a, b, from, to, end), i, thickness);
      });
    }
    if (turned) jump_ = true;
    turned_before_ = turned;
  }

  /// Points i .. end by their length.
  void curve(std::uint32_t i, std::uint32_t end, bool closed) {
    double length = 0;
    for (std::uint32_t k = i; k < end; ++k) length += expand_detail::distance(paths_.point[k], paths_.point[k + 1]);
    LineCut cut = cut_.line;
    cut.origin = 0;
    const std::int64_t whole = std::llround(length);
    if (cut.rule == CutRule::kAligned) cut.rule = CutRule::kThickEnds;  // there is no grid along a curve
    if (closed) {
      const std::int64_t periods = whole / (cut.thin + cut.thick);
      if (periods > 0) cut.thick = whole / periods - cut.thin;
      cut.rule = CutRule::kThickEnds;
      cut.min_end = cut.thick / 2;
    }
    std::uint32_t k = i, corners = end - i - 1;  // that are still to be passed
    double walked = 0, edge = expand_detail::distance(paths_.point[k], paths_.point[k + 1]);
    const auto pass = [&] {
      walked += edge;
      k = k + 1 < end ? k + 1 : i;
      edge = expand_detail::distance(paths_.point[k], paths_.point[k + 1]);
    };
    const auto at = [&](double goal) {  // on the edge from k
      const double share = std::clamp(edge > 0 ? (goal - walked) / edge : 1.0, 0.0, 1.0);
      const Point2 a = paths_.point[k], b = paths_.point[k + 1];
      return Point2{static_cast<Nm>(a.x + std::llround(share * (static_cast<double>(b.x) - a.x))),
                    static_cast<Nm>(a.y + std::llround(share * (static_cast<double>(b.y) - a.y)))};
    };
    Point2 here = paths_.point[k], last = paths_.point[end];
    const std::int64_t shift = closed && whole > 0 ? cut_.shift - floor_div(cut_.shift, whole) * whole : 0;
    if (shift > 0) {
      while (k + 1 < end && walked + edge <= static_cast<double>(shift)) pass();
      here = last = at(static_cast<double>(shift));
      walked -= static_cast<double>(shift);
      ++corners;  // also the one where the curve is stored to begin
    }
    cut_line(cut, 0, whole, [&](std::int64_t, std::int64_t stop, Thickness thickness) {
      const double goal = stop < whole ? static_cast<double>(stop) : INFINITY;
      for (; corners > 0 && walked + edge <= goal; --corners) {
        const Point2 corner = paths_.point[k + 1];
        give(here, corner, i, thickness);
        here = corner;
        pass();
      }
      const Point2 there = stop < whole ? at(goal) : last;
      give(here, there, i, thickness);
      here = there;
    });
    turned_before_ = false;
  }

  void give(Point2 from, Point2 to, std::uint32_t i, Thickness thickness) {
    if (from == to) return;
    visit_(PathInterval{from, to, paths_.kind[i], thickness, paths_.width[i], paths_.line[i], jump_, i});
    jump_ = false;
  }

  const ToolpathsView& paths_;
  const LayerCut& cut_;
  Visit& visit_;
  bool jump_ = true, turned_before_ = false;
};

template <class Visit>
void for_each_interval(const ToolpathsView& paths, const LayerCut& cut, Visit&& visit) {
  Expander<std::remove_reference_t<Visit>>(paths, cut, visit).run();
}

/// What a layer adds to a segmentation.
struct CutPosition {
  bool on = false;
  std::int32_t first = 0;            // number of a segmented line
  bool one_direction = true;         // segmented lines are all deposited the same way
  MicroDegrees angle = 0;            // of the lines of the layer
  double shift_mm = 0;               // of the layer's pores along its lines
  std::optional<double> first_line;  // nm along across(angle + a quarter turn): a segmented line of the layers turned by 90
                                     // degrees; thin segments have their middles on it. Absent: the grid begins where the
                                     // part does
};

/// Unit vector of an angle, in [0, half a turn) once reduced; exact for quarter turns.
std::array<double, 2> direction(MicroDegrees angle);

/// Unit vector across lines of that angle: their direction turned to the left.
std::array<double, 2> across(MicroDegrees angle);

/// Ends of a part's box along a unit vector, nm.
std::array<double, 2> reach(const Box& part, const std::array<double, 2>& along);

/// The cut of a layer. part  nm on the bed: grids of all its layers begin at its side
LayerCut layer_cut(const Segmentation& plan, const CutPosition& position, const Box& part);

/// Refuses a layer whose lines would be cut into more than 10,000,000 stretches. errors  kUsage
/// paths  of one part. layer  its number, for the message
Status check_interval_count(const Segmentation& plan, const LayerCut& cut, const ToolpathsView& paths, std::uint32_t layer);

}  // namespace lamina::segment
