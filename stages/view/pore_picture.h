// stages/view/pore_picture.h: sections of a porous solid, and of what flows through it, as a plot.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/contours.h"  // points
#include "stages/data/plot.h"
#include "stages/data/voxels.h"

namespace lamina::view {

/// Two sections meet: one across an axis, one along it. Each is drawn as solid and void and, where there is a flow, by
/// velocity.
struct PorePicture {
  std::string title;
  std::vector<std::string> captions;  // below it, a line each
  std::string solid_name = "solid";
  int axis = 2;                              // of the flow
  int normal = 1;                            // of the section along it
  std::array<std::uint32_t, 3> position{};   // where sections meet, in voxels of the solid
  std::array<double, 3> corner_mm{};         // where the box begins
  VoxelView solid, through;                  // of one size; void that leads through along the axis
  const Plane* across = nullptr;             // velocity along the axis / its mean, none: no flow; over the whole box
  const Plane* along = nullptr;              // speed / that mean
  std::vector<std::array<Point2, 2>> lines;  // nm: middles of beads of the layer that a section across z cuts, on the bed
  std::vector<double> layer_tops_mm;         // above the bottom of the box, rising: layers are drawn in two greys by turns
};

/// About 1280 pixels wide. What repeats is drawn around the place, several times where it is much shorter than the other
/// side of its section. cost  parallel to nothing; some 2e6 pixels, each looked up in a row of runs
Plot draw_pores(const PorePicture& picture);

// --- colours for numbers, in which equal steps look equal.

/// "rrggbb" of a share 0 .. 1: from dark blue over violet and orange to light yellow, ever lighter, so that it reads in grey
/// too. Lightness, hue and chroma go evenly in the colour space OKLab.
///
/// source  B. Ottosson, "A perceptual color space for image processing" (2020)
std::string scale_colour(double share);

}  // namespace lamina::view
