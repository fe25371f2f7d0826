// stages/segment/segmentation.h: a segmented filling: how its lines are deposited, resolved from settings and the calibration,
// and what it will be, before anything is printed.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "stages/data/status.h"
#include "stages/data/units.h"
#include "stages/segment/calibration.h"

namespace lamina::segment {

enum class CutRule : std::uint8_t {
  kGrid,       // Fukuda: on a grid fixed to the part, thin first; a line between two marks is not divided
  kThickEnds,  // Di Nisio: both ends thick; what the pattern leaves over is shared by them
  kAligned     // on the grid, but a thin segment that the line does not hold whole, and clear of its ends, is thick
};

/// One segmentation as people describe it, lengths in mm; resolve() decides what is absent by a calibration.
struct SegmentSettings {
  bool on = false;
  CutRule rule = CutRule::kAligned;
  double thick_mm = 1.5, thin_mm = 1.5;
  std::optional<double> min_end_mm;  // absent: half of thick_mm
  std::uint32_t continuous = 1;
  std::int32_t first = 0;
  std::optional<double> spacing_sc_mm, spacing_cc_mm;  // centre to centre
  double gap_mm = 0;                                   // wanted between beads, for spacings that are not given
  double thick_extrusion = 100;
  std::optional<double> thin_extrusion;  // absent: as the thick one
  std::optional<double> thick_speed;     // absent: by the extrusion
  double thin_speed = 200;
  std::vector<double> thin_speed_sweep, thin_extrusion_sweep;  // of segmented lines, in turn; test pieces of a calibration
  std::optional<double> thick_width_mm, thin_width_mm, continuous_width_mm;  // that beads will have
  bool one_direction = true;
  bool even_starts = true;  // lines begin with the flow they keep (stages/bead/even_starts.h), if the machine's lag is known
  std::vector<double> shift_mm{0};  // pores are moved along the lines by these, layer by layer in turn
  bool across = false;              // the grid begins so that pores of a layer turned by 90 degrees lie on the same places
};

/// How segmented lines are deposited: the parameters of Di Nisio 2022, Table 1, in mm and %.
struct Segmentation {
  CutRule rule = CutRule::kAligned;
  double thick_mm = 1.5, thin_mm = 1.5;
  double min_end_mm = 0.75;
  std::uint32_t continuous = 1;
  double spacing_sc_mm = 0.43, spacing_cc_mm = 0.40;  // centre to centre
  double thick_extrusion = 100, thin_extrusion = 100;
  double thick_speed = 75, thin_speed = 200;
  double thick_width_mm = 0.45, thin_width_mm = 0.31, continuous_width_mm = 0.39;  // that beads will have

  /// Thin stretches of one segmented line, where lines differ: what is varied on a test piece.
  struct ThinLine {
    double extrusion, speed, width_mm;
  };
  std::vector<ThinLine> sweep;  // of segmented lines in turn, from the first one; empty: all alike
  /// That of segmented line k (negative before the first); also without a sweep.
  ThinLine thin_of(std::int64_t k) const {
    if (sweep.empty()) return {thin_extrusion, thin_speed, thin_width_mm};
    const auto size = static_cast<std::int64_t>(sweep.size());
    return sweep[static_cast<std::size_t>(k - floor_div(k, size) * size)];
  }
};

/// Absent widths, speeds and spacings come from the calibration, in proportion to the bead.
/// bead_mm  width of the filling's beads, > 0
/// errors   of check(): kUsage, one line that begins with the key's name
Result<Segmentation> resolve(const SegmentSettings& settings, const Calibration& calibration, double bead_mm);

/// Centre-to-centre distances, mm, from each line to the next, in turn from line 0.
/// first  number of a segmented line
std::vector<double> line_distances(const Segmentation& segmentation, std::int32_t first);

/// Whether it can be deposited. errors  kUsage, one line that begins with the key's name (as in [segment])
Status check(const Segmentation& segmentation, double bead_width_mm);

/// What a user should know, of the code "pores": a pore that closes, speeds outside of what was measured, beads that do not
/// touch.
std::vector<Warning> warnings(const Segmentation& segmentation, const Calibration& calibration);

/// Beads that are no further apart than this, mm, bond: they spread by as much.
inline constexpr double kBondGap = 0.02;

/// Widths of beads, mm.
struct PoreBeads {
  double thick, thin;
  double other;  // of the line next to them
};

/// 0 or below: closed.
struct PoreSize {
  double length_mm, width_mm;
  double gap_mm;  // between the thick segments and the other line
};

/// Beads are deposited as by a round pen: thick segments end in half circles that reach into the thin one, so a pore is shorter
/// than the thin segment by one thick width; across, it is what the distance of the lines leaves between the thin segment and
/// the other line.
/// length    mm, of the thin segment, between two thick ones
/// distance  mm, between the centres of the lines
inline PoreSize pore_geometry(const PoreBeads& beads, double length, double distance) {
  return {length - beads.thick, distance - (beads.thin + beads.other) / 2, distance - (beads.thick + beads.other) / 2};
}

/// A pore between a thin segment and the continuous line next to it.
struct Pores {
  double length_mm, width_mm;
  double aspect;       // width / length
  double density_mm2;  // pores in a mm2 of a layer: two at each thin segment
};
Pores predict_pores(const Segmentation& segmentation);

}  // namespace lamina::segment
