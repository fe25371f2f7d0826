// stages/segment/pore_geometry.h: the pore between a thin segment and the line next to it: of a plan (predict.h) and of
// deposited toolpaths (laid/pores.h).
#pragma once

namespace lamina::segment {

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

}  // namespace lamina::segment
