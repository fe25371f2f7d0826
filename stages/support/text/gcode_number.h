// stages/support/text/gcode_number.h: numbers of G-code: decimal, with a point, without an exponent.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>

namespace lamina {

/// mm with four digits (a tenth of a micrometre), never -0.
inline std::string mm_text(double millimetres) {
  const double rounded =
      static_cast<double>(static_cast<std::int64_t>(millimetres * 1e4 + (millimetres < 0 ? -0.5 : 0.5))) / 1e4;
  return fmt::format("{:.4f}", rounded == 0 ? 0.0 : rounded);
}

/// A number with up to so many digits behind the point, and no exponent, which G-code does not know.
inline std::string plain_text(double value, int digits) {
  std::string text = fmt::format("{:.{}f}", value, digits);
  if (digits == 0) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

/// The least that is written of a roller's turns a minute, and of seconds to dry: a thousandth.
inline constexpr int kPlainDigits = 3;

/// mm a minute, as F words have it: whole ones but below 1, never 0.
inline std::string feed_text(double mm_s) {
  return mm_s * 60 < 1 ? fmt::format("{:.2f}", mm_s * 60) : fmt::format("{:.0f}", mm_s * 60);
}

}  // namespace lamina
