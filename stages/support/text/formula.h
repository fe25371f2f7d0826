// stages/support/text/formula.h: a number as a formula of named variables, on muParser.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/status.h"

namespace lamina {

/// A formula with + - * / ^, comparisons, `c ? x : y`, min, max, abs, sqrt, exp, ln, sin, cos, tan, rint and _pi (muParser
/// 2.3). Names are not assigned to. Not shared between threads.
class Formula {
 public:
  /// names   of its variables, in the order of their values
  /// errors  kUsage: what is wrong, and at which character
  static Result<Formula> parse(const std::string& text, std::span<const std::string_view> names);
  Formula(Formula&&) noexcept;
  Formula& operator=(Formula&&) noexcept;
  ~Formula();

  const std::string& text() const;
  /// Whether the formula looks at a variable.
  bool uses(std::string_view name) const;
  /// Its value, finite or not. values  of all variables; errors  kUsage: there is none
  /// cost    some tens of nanoseconds
  Result<double> operator()(std::span<const double> values);

 private:
  Formula();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina
