#include "stages/support/text/value.h"

#include <cmath>

#include "stages/support/text/readable.h"

namespace lamina {

namespace {

std::string check_digits(double value, const Limits& limits) {
  if (limits.digits == 0) return {};
  const double unit = std::pow(10.0, limits.digits);
  return std::round(value * unit) / unit == value
             ? std::string()
             : fmt::format("{} has too many digits after the point; give at most {}", number_text(value), limits.digits);
}

}  // namespace

std::string read_value(std::string_view text, const Limits& limits, double& value) {
  double read = 0;
  std::string wrong = read_number(text, limits.low, limits.high, limits.unit, read);
  if (wrong.empty()) wrong = check_digits(read, limits);
  if (wrong.empty()) value = read;
  return wrong;
}
std::string read_value(std::string_view text, const Limits&, bool& value) { return read_switch(text, value); }

std::string check_value(double value, const Limits& limits) {
  return value >= limits.low && value <= limits.high  // nan is not
             ? check_digits(value, limits)
             : fmt::format("{} is out of range; give a number from {} to {}{}", number_text(value), limits.low, limits.high,
                           limits.unit);
}
std::string check_value(std::int64_t value, const Limits& limits) {
  const auto low = static_cast<std::int64_t>(limits.low), high = static_cast<std::int64_t>(limits.high);
  return value >= low && value <= high ? std::string()
                                       : fmt::format("{} is out of range; give a whole number from {} to {}", value, low, high);
}

std::string check_length(std::size_t length, const Limits& limits) {
  if (length < limits.minimum) return fmt::format("has {} values; give at least {}", length, limits.minimum);
  if (length > limits.maximum) return fmt::format("has {} values; give at most {}", length, limits.maximum);
  return {};
}

std::string not_one_of(std::string_view text, std::span<const std::string_view> words) {
  return fmt::format("unknown value '{}'; use one of {}{}", text, fmt::join(words, ", "), suggest(text, words));
}

std::string check_path(std::string_view text) {
  if (text.empty()) return "is empty; give a file or directory";
  if (text.find('\0') != std::string_view::npos) return "contains a zero byte; give a file or directory";
  return {};
}

}  // namespace lamina
