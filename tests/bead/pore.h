// tests/bead/pore.h: the pore between a thin segment and the even line next to it.
//
// Both beads have the widths that they have alone: what neighbours push aside is neighbours.h. Widths are at the middle of the
// layer's height, where beads are widest. How long a pore is depends on where it is said to end: its sides close slowly.
// Against Di Nisio 2022, Table 16, see tests/bead/test_tables.cpp.
#pragma once

#include "stages/bead/predicted_tables.h"

namespace lamina::bead {

struct BeadPore {
  double width;        // mm, in the middle of the thin segment; 0 or below: none
  double widest;       // of all places
  double half_length;  // mm around that middle where it is at least half as wide as there
  double open_length;  // mm around that middle where beads do not bond: no nearer than bond_gap; the whole period at most
};

/// spacing     mm, centre to centre
/// adjacent_mm   mm, width of the line next to it
/// bond_gap    mm: beads that are no further apart bond
BeadPore adjacent_pore(const BeadMachine& machine, double height_mm, const Pattern& pattern, double spacing_mm,
                       double adjacent_mm, double bond_gap_mm, bool spread);

}  // namespace lamina::bead
