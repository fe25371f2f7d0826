// stages/infill/spacing.h: where the lines of a layer lie, across their direction. Straight lines, waves and closed
// curves all take their places from here, so that gaps, groups, tables, formulas and staggers mean the same for each.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/infill/parameters.h"
#include "stages/support/text/formula.h"

namespace lamina::infill {

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

/// Lines of a layer by the gaps or distances of the parameters.
/// errors  kUsage: a distance that is not positive, with the line after which it would be; an expression that fails
/// cost    O(lines from the part's side to the far end of what is filled)
Result<LinePositions> line_positions(const FillParameters& parameters, const FillContext& context, const Extent& extent);

/// Where line 0 lies from the part's side, before the stagger: first_line, or its default.
/// errors  as line_positions
Result<std::int64_t> first_position(const FillParameters& parameters, const FillContext& context, const Extent& extent);

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

  /// Whether the formula looks at a variable.
  bool uses(std::string_view variable) const { return formula_.uses(variable); }
  /// errors  kUsage: no finite number, and for which variables
  Result<double> operator()(const Variables& variables);

 private:
  explicit Expression(Formula formula) : formula_(std::move(formula)) {}
  Formula formula_;
};

}  // namespace lamina::infill
