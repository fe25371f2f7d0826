// tests/calibration/scan/synthetic.h: photographs of printed sheets, made up. Nothing here knows OpenCV, or what
// stages/calibration/scan searches for.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <random>
#include <set>
#include <vector>

#include "stages/data/program.h"
#include "stages/data/runs.h"

namespace lamina::test {

/// What a printer does to a layer. Offsets in pixels of the layer, along the scan and across it.
struct Printing {
  std::set<std::uint32_t> blocked;
  std::vector<std::array<double, 2>> nozzle;  // of each nozzle; empty: none
  std::vector<std::array<double, 2>> swath;   // of each swath from the bed's first; empty: none
  double gain_um = 0;                         // that edges stand out
  double jitter_um = 0;                       // of each dot, standard deviation in both directions
  double satellites = 0;                      // share of dots with a smaller one 60 um behind, along the scan
  std::uint64_t seed = 1;                     // of both
  /// Whether a line of the layer is left out.
  std::function<bool(std::uint32_t)> skips = [](std::uint32_t) { return false; };
};

/// What a camera does to a sheet.
struct Camera {
  double pixels_a_mm = 20, turn_deg = 0, tilt_x = 0, tilt_y = 0, lens = 0;  // tilts: change of scale over half the picture
  double margin_mm = 4;
  double blur_pixels = 1, noise = 3;                 // of the grey values
  double grain = 0;                                  // of the paper's light, standard deviation in spots of 0.1 mm
  double paper = 0.8, ink = 0.15;                    // light that comes back
  double shade_x = 0, shade_y = 0, vignette = 0;     // of the light
  std::uint32_t dark_specks = 0, bright_specks = 0;  // of 0.03 to 0.25 mm
};

struct GreyPicture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> grey;
};

/// The light that a sheet sends back where ink covers it by a share: 0 .. 1, area-sampled every `step` mm.
struct Sheet {
  double left = 0, top = 0, step = 0.02;  // mm of the image
  int columns = 0, rows = 0;
  std::vector<float> cover;
};

/// grid   whose swaths share no lines and begin with the bed
Sheet print_sheet(const HeadGrid& grid, const RunsView& layer, const Printing& printing);
GreyPicture photograph(const Sheet& sheet, const Camera& camera, std::mt19937_64& random);

}  // namespace lamina::test
