// pipeline/machine/import/bed_outline.h: the outline of a bed as other slicers write it.
#pragma once

#include <array>
#include <string_view>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// In the machine's coordinates, mm.
struct BedOutline {
  std::array<double, 2> corner_mm{}, size_mm{};
  bool rectangular = true;  // else the rectangle around the same centre, of the outline's proportions, that is within it
};

/// Reads "0x0,220x0,220x220,0x220".
/// errors  kUsage: what is wrong, to follow the key's name
Result<BedOutline> read_bed_outline(std::string_view text);

}  // namespace lamina::pipeline
