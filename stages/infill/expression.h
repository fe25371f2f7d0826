// stages/infill/expression.h: a gap as a formula.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "stages/data/status.h"
#include "stages/support/text/formula.h"

namespace lamina::infill {

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
