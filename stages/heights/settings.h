// stages/heights/settings.h: how layers are decided, in the units of people.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "stages/data/layer.h"

namespace lamina::heights {

enum class Mode : std::uint8_t {
  kUniform,   // one thickness
  kAngle,     // thinner where a facet is flatter than an angle, or to meet a horizontal face (Lima 2009)
  kCusp,      // from the bottom up, each layer as thick as the step on the slopes allows (Dolenc and Makela 1994)
  kStepwise,  // slabs of the greatest thickness, each divided evenly (Sabourin, Houser and Bohn 1996)
  kOptimal    // the fewest layers, or the least time, of all tables that keep the step and end on the flats
};

/// The word that stands for it in options and job files.
constexpr std::string_view mode_name(Mode mode) {
  constexpr std::string_view kNames[] = {"uniform", "angle", "cusp", "stepwise", "optimal"};
  return kNames[static_cast<std::size_t>(mode)];
}

/// Which slopes a layer considers: all that reach into it, or only those that its bounding plane cuts, as the cited
/// documents do. The latter can miss slopes between two planes.
enum class Facets : std::uint8_t { kRange, kPlane };

/// Which horizontal faces are peaks for kAngle: those that are flats, or every horizontal facet as in the documents.
enum class Peaks : std::uint8_t { kFlats, kFacets };

/// Of a part that is stretched to make up for its shrinkage: the steps that are printed, or those that are left on it once it
/// has shrunk to its nominal size.
enum class CuspOf : std::uint8_t { kPrinted, kNominal };

/// Lengths in mm, angles in degrees.
struct Settings {
  Mode mode = Mode::kUniform;
  std::string thickness_mm;  // "0.178,0.254" or "0.05..0.3:0.01"; empty: one thickness, which stands elsewhere
  double cusp_mm = 0.1;
  CuspOf cusp_of = CuspOf::kPrinted;
  double adapt_angle_deg = 45;
  double peak_angle_deg = 90;
  double normal_tolerance = 1e-3;
  Facets facets = Facets::kRange;
  double min_facet_mm2 = 0;
  Peaks peaks = Peaks::kFlats;
  bool cover_top = false;
  bool flats = true;
  double min_flat_mm2 = 1;
  double flat_tolerance_um = 1;
  std::array<double, 2> time_model{0, 0};  // seconds a layer, seconds a mm2 of its section
  Containment containment = Containment::kAcross;
  bool per_part = false;
};

}  // namespace lamina::heights
