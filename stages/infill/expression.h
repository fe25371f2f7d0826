// stages/infill/expression.h: a gap as a formula, on muParser.
#pragma once

#include <memory>
#include <string>

#include "stages/data/status.h"

namespace lamina::infill {

/// A formula over these variables, all numbers:
///   z  mm, middle of the layer above the part's bottom      h  the same as a share of the part's height, 0 .. 1
///   n  number of the layer, from 1                          a  degrees, direction of its lines
///   i  number of the line before the gap                    s  mm, its distance from the part's side, across the lines
///   u  the same as a share of the part's extent, 0 .. 1
/// (s and u of what lies outside of the part are those of its nearer side)
/// with + - * / ^, comparisons, `c ? x : y`, min, max, abs, sqrt, exp, ln, sin, cos, tan, rint and _pi (muParser 2.3).
/// Names are not assigned to. Not shared between threads.
class Expression {
 public:
  struct Variables {
    double z = 0, h = 0, n = 0, a = 0, i = 0, s = 0, u = 0;
  };
  /// errors  kUsage: what is wrong, and at which character
  static Result<Expression> parse(const std::string& text);
  Expression(Expression&&) noexcept;
  ~Expression();

  /// Whether the formula looks at a variable.
  bool uses(const std::string& variable) const;
  /// errors  kUsage: no finite number, and for which variables
  Result<double> operator()(const Variables& variables);

 private:
  Expression();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::infill
