// stages/infill/parameters.h: how a layer is filled. Every porous strategy is a few of these numbers, and all combine.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/extruder.h"  // BeadShape
#include "stages/data/layer.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/units.h"
#include "stages/infill/settings.h"

namespace lamina::infill {

/// All lengths nm. The gap after line i of a layer (i = 0 is the first line, see `first_line`) is, in this order:
///   0           inside a group: where (i + 1) is no multiple of `group`
///   expression  if there is one
///   table       if there is one: between its heights in proportion, beyond them constant
///   list        else, entry by entry in turn; after a group, one entry further
/// and the distance of line i + 1 from line i, centre to centre, is `width` + gap. Distances that are given themselves
/// (`distances`) take the place of all this.
struct FillParameters {
  Pattern pattern = Pattern::kRaster;
  Nm width = 400'000;       // of a filling bead
  Nm wall_width = 400'000;  // of a wall's bead
  std::uint32_t walls = 1;  // contours along the surface; their centres at 1/2, 3/2, ... of wall_width inside it
  Seam seam = Seam::kContour;
  std::uint32_t loops = 1;  // kContourRaster: closed curves before the raster

  // --- direction: angle_base + floor(layer / build_layers) * angle_step, modulo 360 degrees
  MicroDegrees angle_base = 45'000'000;
  MicroDegrees angle_step = 90'000'000;
  std::uint32_t build_layers = 1;  // layers in a row with one angle

  // --- distance between lines
  std::vector<Nm> gaps{0};                             // edge to edge; may be negative
  std::uint32_t group = 1;                             // beads in contact before a gap
  std::vector<std::pair<std::int64_t, Nm>> gap_table;  // (height above the part's bottom, gap), heights increasing
  std::string gap_expression;                          // mm; see layout.h for its variables
  std::vector<Nm> distances;                           // centre to centre, in turn; empty: by gaps

  // --- stagger: lines of layers with the same angle are moved sideways by these amounts in turn
  std::vector<Nm> stagger{0};
  bool stagger_every_layer = false;  // the turn continues with every layer, not with every return of the angle

  std::optional<Nm> first_line;    // distance of line 0 from the part's side, across the lines; no line of any layer is
                                   // nearer to either side. Absent: one distance from the centre of the innermost wall
  std::optional<Nm> end_inset;     // of line ends from the centre of the innermost wall (from the surface without
                                   // walls). Absent: beads touch the wall, or overlap it as they do each other
  std::int64_t longest_link = -1;  // between two lines along the edge; -1: three distances; 0: no links
  Nm shortest_line = 0;            // shorter lines are left out
  bool fills_corners = false;      // kRaster: the ends of paths follow the edge into corners that no line reaches
  Nm cell = 2'000'000;             // kHoneycomb, kQuatrefoil: cells across flats, centre to centre

  // --- by density (density.h): all of the above that spaces lines is unused
  std::optional<double> density;                           // 0 .. 1
  BeadShape shape = BeadShape::kStadium;                   // cross-section of the beads, which decides their pitch
  bool varies_width = true;                                // else only beads of the set width are made
  Nm nominal_thickness = 200'000;                          // of the layers in which sparse lines are `width` wide
  Nm top = 0, bottom = 0;                                  // thickness of skins; 0: none
  std::optional<std::uint32_t> top_layers, bottom_layers;  // instead
};

/// Settings as the stage takes them, in nm and micro-degrees; not checked, see check() in fill.h.
FillParameters parameters_of(const FillSettings& settings);

/// The mean distance of lines, mm; for estimates: tables and expressions of gaps do not count.
double mean_distance_mm(const FillParameters& fill);

/// The mean distance of lines or closed curves that all touch their neighbours, nm; nothing if some may have gaps, or if a
/// density spaces them.
std::optional<double> touching_distance(const FillParameters& fill);

/// Where a layer stands in its part.
struct FillContext {
  Layer layer;
  Box part;          // nm on the bed: lines are placed from its sides, so that they lie the same in every layer
  Nm tolerance = 0;  // nm by which merging points may move walls and the edge of what is filled
};

/// Direction of the lines of a layer, 0 .. kTurn - 1.
MicroDegrees layer_angle(const FillParameters& parameters, std::uint32_t layer);

/// The sideways shift of a layer: stagger[j modulo its size], where j counts how often the layer's direction (modulo
/// 180 degrees) has come back since layer 0.
Nm layer_stagger(const FillParameters& parameters, std::uint32_t layer);

}  // namespace lamina::infill
