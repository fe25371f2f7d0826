// stages/dose/saturate.h: less binder inside of a part than in its shell, by a pattern of pixels.
#pragma once

#include <cstdint>

#include "stages/data/runs.h"

namespace lamina::dose {

/// Whether a pixel of a core is jetted: the fractional part of a c + b r + g l is below the share, where a, b and g are
/// (sqrt 5 - 1) / 2, (sqrt 13 - 3) / 2 and sqrt 2 - 1 as whole 32-bit fractions. Their continued fractions are all ones,
/// threes and twos, so that along columns, along rows and from layer to layer the set pixels of every line are the target
/// share, evenly spread, and no streak forms in any of the three directions.
/// source  Niederreiter, "Random Number Generation and Quasi-Monte Carlo Methods" (1992), section 3.1
constexpr bool core_pixel(std::uint32_t column, std::uint32_t row, std::uint32_t layer, std::uint32_t threshold) {
  return column * 2'654'435'769u + row * 1'300'411'463u + layer * 1'779'033'705u < threshold;
}

/// The threshold of a share in [0, 1).
std::uint32_t core_threshold(double share);

/// Full binder in the shell, a share of it in the core.
/// core    of the same size as the image and within it
/// layer   number of the layer: patterns differ from layer to layer, and are the same for the same job
/// result  the image without the pixels of the core that the pattern leaves out
/// cost    O(changes + pixels of the core)
void saturate(const RunsView& image, const RunsView& core, double share, std::uint32_t layer, Runs& result);

}  // namespace lamina::dose
