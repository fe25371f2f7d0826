// stages/data/saturation.h: how much of the powder's voids binder is to fill.
#pragma once

#include <string>
#include <utility>

namespace lamina {

/// Per cent of the powder's voids: a number, or a formula of the position (stages/dose/field.h).
struct Saturation {
  double percent = 0;
  std::string formula;  // of x, y and z in mm; empty: the number

  Saturation() = default;
  Saturation(double of_voids) : percent(of_voids) {}
  static Saturation of(std::string text) {
    Saturation saturation;
    saturation.formula = std::move(text);
    return saturation;
  }
  bool operator==(const Saturation&) const = default;
};

}  // namespace lamina
