#include "stages/view/colour_scale.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::view {
namespace {

/// Of linear light 0 .. 1, as sRGB has it (IEC 61966-2-1).
int byte_of(double light) {
  light = std::clamp(light, 0.0, 1.0);
  const double value = light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
  return static_cast<int>(std::lround(255 * value));
}

}  // namespace

std::string scale_colour(double share) {
  share = std::clamp(share, 0.0, 1.0);
  const double lightness = 0.22 + 0.74 * share, hue = (270 + 200 * share) * std::numbers::pi / 180;
  const double chroma = 0.07 + 0.11 * std::sin(std::numbers::pi * std::min(1.0, 0.1 + share));
  const double a = chroma * std::cos(hue), b = chroma * std::sin(hue);
  const auto cubed = [](double x) { return x * x * x; };
  const double l = cubed(lightness + 0.3963377774 * a + 0.2158037573 * b),
               m = cubed(lightness - 0.1055613458 * a - 0.0638541728 * b),
               s = cubed(lightness - 0.0894841775 * a - 1.2914855480 * b);
  return fmt::format("{:02x}{:02x}{:02x}", byte_of(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
                     byte_of(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
                     byte_of(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s));
}

}  // namespace lamina::view
