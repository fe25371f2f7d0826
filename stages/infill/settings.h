// stages/infill/settings.h: how a layer is filled, in the units of people.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace lamina::infill {

enum class Pattern : std::uint8_t {
  kNone,           // walls only
  kRaster,         // parallel lines, zigzag
  kContour,        // closed curves at equal distances, inwards
  kContourRaster,  // some of those, then a raster inside them
  kHoneycomb,      // trapezoid waves that touch: hexagonal cells
  kQuatrefoil,     // round waves kept apart: no closed cells in a layer
  kLines,          // parallel lines without links; of a density only
  kGrid,           // lines in two directions in every layer; of a density only
  kGyroid          // sections of a gyroid, a surface that divides space into two equal labyrinths; of a density only
};

/// Where the beads of walls begin (seam.h).
enum class Seam : std::uint8_t { kContour, kAligned, kRear, kNearest };

/// Whether a pattern is spaced by a density alone.
constexpr bool needs_density(Pattern pattern) { return pattern >= Pattern::kLines; }

/// One filling as people describe it: lengths in mm, angles in degrees. Lists are taken in turn.
struct FillSettings {
  Pattern pattern = Pattern::kNone;
  double width_mm = 0.4;
  double wall_width_mm = 0;  // 0: like width_mm
  std::uint32_t walls = 0;
  Seam seam = Seam::kContour;
  std::uint32_t loops = 1;
  double angle_deg = 45, angle_step_deg = 90;
  std::uint32_t build_layers = 1;
  std::vector<double> gap_mm{0};
  std::vector<double> distance_mm;
  std::uint32_t group = 1;
  std::vector<std::array<double, 2>> gap_by_height;  // height above the part's bottom, increasing, and gap
  std::string gap_formula;
  std::vector<double> stagger_mm{0};
  bool stagger_every_layer = false;
  std::optional<double> first_line_mm, end_inset_mm, link_mm;
  double shortest_mm = 0;
  double cell_mm = 2;
  // --- a filling by its share of the volume inside the walls (density.h), in place of gaps and distances
  std::optional<double> density_percent;
  double top_mm = 0.8, bottom_mm = 0.6;                    // thickness of solid skins below and above horizontal faces
  std::optional<std::uint32_t> top_layers, bottom_layers;  // of skins, instead of their thickness
};

}  // namespace lamina::infill
