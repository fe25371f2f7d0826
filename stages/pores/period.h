// stages/pores/period.h: after how far a pattern repeats.
#pragma once

#include <cstdint>

#include "stages/data/runs.h"

namespace lamina::pores {

/// The smallest shift along an axis of an image, in pixels, at which nearly all of it covers itself.
///
/// columns  the shift is along rows, else across them
/// least    shifts below this are not looked at, nor those above a two fifths of the image: three periods have to be there
/// miss     share of the set pixels that may differ, and no more than 15 % of what differs at the worst shift; of several
/// shifts
///          in a row that pass, the one that differs least is taken
/// returns  `least` for an image that is the same all along; 0 if there is no period, or the image is empty or full
/// cost     O(runs) a shift
std::uint32_t period(const RunsView& image, bool columns, std::uint32_t minimum, double miss);

/// The share of the set pixels of two images of one size that are set in one of them alone, of those of both; 0 of empty ones.
double mismatch(const RunsView& one, const RunsView& other);

}  // namespace lamina::pores
