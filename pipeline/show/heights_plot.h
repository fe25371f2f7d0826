// pipeline/show/heights_plot.h: thickness against height, beside the part's outline.
#pragma once

#include <string>
#include <vector>

#include "pipeline/plan/heights_study.h"

namespace lamina::pipeline {

/// Boxes and lines of text, in pixels from the top left: what both SVG and PNG are made of.
struct Drawing {
  struct Box {
    double left, top, width, height;
    std::string colour;  // "rrggbb"
  };
  enum class Anchor { kStart, kMiddle, kEnd };
  struct Text {
    double x, baseline;
    int size;
    Anchor anchor;
    std::string colour, line;
  };
  int width = 0, height = 0;
  std::vector<Box> boxes;  // later ones cover earlier ones, text covers all
  std::vector<Text> texts;
};

/// cost  O(triangles * rows they span + layers)
Drawing draw_study(const Scene& scene, const HeightsStudy& study);

std::string svg_text(const Drawing& drawing);
/// The same for lamina-preview: "drawing WIDTH HEIGHT", then "box L T W H rrggbb" and "text X Y SIZE ANCHOR rrggbb LINE".
std::string drawing_text(const Drawing& drawing);

/// Whether a plot can have this name: empty, .svg or .png. errors  kUsage
Status check_plot_name(const std::string& path);

/// Draws a study into an .svg, or a .png by handing over to lamina-preview. returns the exit code; errors are said
int draw_heights(const std::string& path, const Job& job, const Scene& scene, const HeightsStudy& study);

}  // namespace lamina::pipeline
