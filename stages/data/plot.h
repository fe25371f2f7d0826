// stages/data/plot.h: a plot as shapes and lines of text, which stages/formats draws as SVG (svg/) and as PNG (picture/).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace lamina {

/// Places and sizes are pixels from the top left; colours are "rrggbb". Boxes lie below images, these below lines, lines below
/// dots, text above all; within a kind later ones cover earlier ones. The ground is white.
struct Plot {
  struct Box {
    double left = 0, top = 0, width = 0, height = 0;
    std::string colour;
  };
  /// Pixels in rows from the top, as numbers of colours; one is as large as one of the plot.
  struct Image {
    int left = 0, top = 0, columns = 0;
    std::vector<std::string> colours;  // 256 at most
    std::vector<std::uint8_t> pixels;
  };
  struct Line {
    std::vector<std::array<double, 2>> points;  // a pixel wide
    std::string colour;
  };
  struct Dot {
    double x = 0, y = 0, radius = 0;
    std::string colour;
  };
  enum class Anchor { kStart, kMiddle, kEnd };
  struct Text {
    double x = 0, baseline = 0;
    int size = 0;
    Anchor anchor = Anchor::kStart;
    std::string colour, line;
  };
  int width = 0, height = 0;
  std::vector<Box> boxes;
  std::vector<Image> images;
  std::vector<Line> lines;
  std::vector<Dot> dots;  // half transparent, so that many at one place are darker
  std::vector<Text> texts;
};

// --- round numbers along the axes of plots.

/// 1, 2 or 5 times a power of ten, so that about `count` steps cover `span`; both above 0.
inline double tick_step(double span, int count) {
  const double raw = span / count, power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw) return factor * power;
  }
  return 10 * power;
}

}  // namespace lamina
