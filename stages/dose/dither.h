// stages/dose/dither.h: fractions of drops a pixel, or of the pixels of a core, become whole drops, evenly spread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/drop_image.h"
#include "stages/data/levels.h"
#include "stages/dose/saturation.h"

namespace lamina::dose {

/// The zones of a layer: every pixel gets the whole drops of its level, and one more where the remaining fraction is above the
/// threshold of the blue-noise tile (blue_noise.h) as it lies in this layer. Thresholds have 24 bits: the rank of the pixel,
/// and below it an offset that goes through 1024 places from layer to layer, so that fractions finer than a tile can show come
/// out right over the layers. drops  a pixel of each level, [0] for level 0 is not read; at most 256, each at most kMaxDrops
/// layer  its number: the same for the same job
/// cost   O(tile) a level whose drops are not whole
void make_zones(std::span<const Drops24> drops, std::uint32_t layer, DropPatterns& result);

/// The thresholds of a layer, for stretches of pixels that each have a number of drops of their own: the same drops as those
/// of make_zones(). Scratch; keeps its capacity.
class Thresholds {
 public:
  /// cost  O(tile)
  void start(std::uint32_t layer);
  /// Appends [begin, end) of a row. drops  a pixel, at most kMaxDrops; cost  O(pixels) where they are not whole
  void append(std::uint32_t begin, std::uint32_t end, std::uint32_t row, Drops24 drops, Levels& result) const;
  std::uint64_t bytes() const { return of_tile_.capacity() * sizeof(std::uint32_t); }

 private:
  std::vector<std::uint32_t> of_tile_;  // row by row, turned to the layer's shift
};

/// The threshold of a share in [0, 1).
inline std::uint32_t core_threshold(double share) {
  return static_cast<std::uint32_t>(std::clamp(std::llround(share * 4294967296.0), 0ll, 4294967295ll));
}

/// The zones of a layer with full binder in the shell, level 1, and a share of it in the core, level 2.
/// A pixel of the core is jetted if the fractional part of a c + b r + g l is below the share, where a, b and g are
/// (sqrt 5 - 1) / 2, (sqrt 13 - 3) / 2 and sqrt 2 - 1 as whole 32-bit fractions. Their continued fractions are all ones,
/// threes and twos, so that along columns, along rows and from layer to layer the set pixels of every line are the target
/// share, evenly spread, and no streak forms in any of the three directions.
/// source  Niederreiter, "Random Number Generation and Quasi-Monte Carlo Methods" (1992), section 3.1
/// layer  number of the layer: patterns differ from layer to layer, and are the same for the same job
void make_core(double share, std::uint32_t layer, DropPatterns& result);

}  // namespace lamina::dose
