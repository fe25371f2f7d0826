#include "stages/infill/expression.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

namespace lamina::infill {

Result<Expression> Expression::parse(const std::string& text) {
  static constexpr std::string_view kNames[] = {"z", "h", "n", "a", "i", "s", "u"};
  auto formula = Formula::parse(text, kNames);
  if (!formula) return formula.error();
  return Expression(std::move(*formula));
}

Result<double> Expression::operator()(const Variables& of) {
  const std::array values{of.z, of.h, of.n, of.a, of.i, of.s, of.u};
  const Result<double> value = formula_(values);
  if (value && !std::isfinite(*value)) {
    return Error{Fault::kUsage, fmt::format("'{}': is {} where z = {:g}, n = {:g}, i = {:g}, s = {:g}; it has to be a "
                                            "finite number of mm",
                                            formula_.text(), *value, of.z, of.n, of.i, of.s)};
  }
  return value;
}

}  // namespace lamina::infill
