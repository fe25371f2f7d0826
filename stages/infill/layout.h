// stages/infill/layout.h: the positions of the lines, waves or closed curves of one layer, before any is deposited. All take
// their places from here, so that gaps, groups, tables, formulas and staggers mean the same for each.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <string_view>
#include <utility>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/status.h"
#include "stages/infill/parameters.h"
#include "stages/support/text/formula.h"

namespace lamina::infill {

/// u runs along the lines, v across them, nm from a centre. Whole quarter turns are exact; others are rounded to the
/// nearest nm, so that a point there and back again is off by at most 1 nm in x and y.
///
/// Directions that differ by half a turn share a frame: their lines are the same lines, deposited the other way.
class Frame {
 public:
  Frame(MicroDegrees angle, Point2 centre)
      : quarter_(static_cast<int>(angle % (kTurn / 2) / (kTurn / 4))),
        exact_(angle % (kTurn / 4) == 0),
        reversed_(angle >= kTurn / 2),
        centre_(centre) {
    const double turn = static_cast<double>(angle % (kTurn / 2)) * 1e-6 * std::numbers::pi / 180;
    cos_ = std::cos(turn);
    sin_ = std::sin(turn);
  }

  /// Whether lines are deposited towards -u first.
  bool reversed() const { return reversed_; }

  Point2 to(Point2 p) const {
    const std::int64_t x = std::int64_t{p.x} - centre_.x, y = std::int64_t{p.y} - centre_.y;
    if (exact_) return quarter_ == 0 ? whole(x, y) : whole(y, -x);
    const auto u = static_cast<double>(x), v = static_cast<double>(y);
    return whole(std::llround(cos_ * u + sin_ * v), std::llround(cos_ * v - sin_ * u));
  }

  Point2 from(Point2 p) const {
    if (exact_) {
      return quarter_ == 0 ? whole(std::int64_t{p.x} + centre_.x, std::int64_t{p.y} + centre_.y)
                           : whole(std::int64_t{centre_.x} - p.y, std::int64_t{centre_.y} + p.x);
    }
    const double u = p.x, v = p.y;
    return whole(std::llround(cos_ * u - sin_ * v) + centre_.x, std::llround(sin_ * u + cos_ * v) + centre_.y);
  }

  Contours to(const ContoursView& contours) const {
    Contours turned;
    turned.offset.assign(contours.offset.begin(), contours.offset.end());
    turned.point.resize(contours.point.size());
    for (std::size_t i = 0; i < contours.point.size(); ++i) turned.point[i] = to(contours.point[i]);
    return turned;
  }

  /// The box around a turned one, in u and v.
  Box to(const Box& box) const {
    Box turned;
    for (const Nm x : {box.lo.x, box.hi.x}) {
      for (const Nm y : {box.lo.y, box.hi.y}) {
        const Point2 p = to(Point2{x, y});
        turned.add(Point3{p.x, p.y, 0});
      }
    }
    return turned;
  }

 private:
  static Point2 whole(std::int64_t x, std::int64_t y) { return {static_cast<Nm>(x), static_cast<Nm>(y)}; }

  int quarter_;
  bool exact_, reversed_;
  double cos_, sin_;
  Point2 centre_;
};

/// Lines first_number, first_number + 1, ... at these places, nm, strictly increasing.
struct LinePositions {
  std::int32_t first_number = 0;
  Buffer<std::int64_t> at;
};

/// What the distances are measured against, nm across the lines.
struct Extent {
  std::int64_t side;             // of the part, where line numbers begin
  std::int64_t length;           // of the part
  std::int64_t low, high;        // of what is filled: only lines within are wanted
  std::int64_t line_height = 0;  // of a wave, from trough to crest: the next line lies so much further
  bool off_sides = true;         // no line is nearer to either side of the part than line 0 of an unstaggered layer
};

/// Where line 0 lies from the part's side, before the stagger: first_line, or its default.
/// errors  kUsage: a distance that is not positive, with the line after which it would be; an expression that fails
Result<std::int64_t> first_position(const FillParameters& parameters, const FillContext& context, const Extent& extent);

/// The frame in which the layer's lines run along +u.
Frame frame_of(const FillContext& context, const FillParameters& parameters);

/// How far inside the surface the region of bead centres begins, nm: past the walls.
/// errors  of first_position
Result<std::int64_t> region_depth(const FillContext& context, const FillParameters& parameters);

/// Lines of a raster, or troughs of waves, across `region` (in the frame).
/// errors  of first_position
/// cost    O(lines from the part's side to the far end of what is filled)
Result<LinePositions> positions_across(const ContoursView& region, const Frame& frame, const FillContext& context,
                                       const FillParameters& parameters);

/// Closed curves: their depths below the surface, nm, from the first one inwards, as far as any can lie in `region`.
/// The list of distances is the one that lines follow; line 0 is the curve at the region's edge, or first_line deep.
/// errors and cost  as positions_across
Result<LinePositions> positions_inwards(const ContoursView& region, const FillContext& context,
                                        const FillParameters& parameters);

// --- a gap as a formula.

/// A formula over these variables, all numbers:
///   z  mm, middle of the layer above the part's bottom      h  the same as a share of the part's height, 0 .. 1
///   n  number of the layer, from 1                          a  degrees, direction of its lines
///   i  number of the line before the gap                    s  mm, its distance from the part's side, across the lines
///   u  the same as a share of the part's extent, 0 .. 1
/// (s and u of what lies outside of the part are those of its nearer side)
/// with what a Formula has (stages/support/text/formula.h). Not shared between threads.
class Expression {
 public:
  struct Variables {
    double z = 0, h = 0, n = 0, a = 0, i = 0, s = 0, u = 0;
  };
  /// errors  kUsage: what is wrong, and at which character
  static Result<Expression> parse(const std::string& text);

  /// Whether the formula uses a variable.
  bool uses(std::string_view variable) const { return formula_.uses(variable); }
  /// errors  kUsage: no finite number, and for which variables
  Result<double> operator()(const Variables& variables);

 private:
  explicit Expression(Formula formula) : formula_(std::move(formula)) {}
  Formula formula_;
};

}  // namespace lamina::infill
