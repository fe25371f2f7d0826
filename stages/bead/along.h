// stages/bead/along.h: melt that finds no room beside its neighbours flows along its own line.
//
// Between two beads that leave it none, melt is pushed along the line, half of it forwards and half back, to the nearest places
// where cusps are open or a side is free. Volume is kept. Assumed: it flows as easily as that, however far it is. A free side
// takes a twentieth of its bead in each of eight rounds (contacts.h): what lies about is levelled so far, and no measurement
// decided how far.
#pragma once

#include <span>

#include "stages/bead/contacts.h"

namespace lamina::bead {

/// pieces   of a layer in the order of printing; those that follow each other without a gap are a line. Areas and widths change
///          where melt leaves or comes
/// sides    one for each piece, as find_contacts() has them afterwards
/// returns  mm3 that find no room on their whole line and are left out
/// cost     that of find_contacts(), up to nine times where there is no room. Same for any threads
double flow_along(std::span<LaidPiece> pieces, double height_mm, Buffer<PieceSides>& sides);

}  // namespace lamina::bead
