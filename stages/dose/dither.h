// stages/dose/dither.h: fractions of drops a pixel, or of the pixels of a core, become whole drops, evenly spread, on runs.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/dose/saturation.h"

namespace lamina::dose {

/// Scratch for dither(); keeps its capacity. The pixels of the tile that get one drop more, as bits, for each level.
struct DitherScratch {
  struct Extra {
    std::vector<std::uint64_t> bits;  // three words a row of the tile, turned to the layer's shift; the third is the first
    bool made = false;
  };
  /// The pixels of a level that get a drop: in all rows the same word, or those of the tile.
  struct Bits {
    const std::uint64_t* words;
    std::uint32_t stride;   // 0: the word is of all rows
    std::uint32_t maximum;  // pixels of a run that matter: one where all are equal
  };
  std::vector<Extra> of_level;
  std::vector<Bits> bits_of;  // a level, of dither_one()
};

/// Every pixel gets the whole drops of its level, and one more where the remaining fraction is above the threshold of the
/// blue-noise tile (blue_noise.h) as it lies in this layer. Thresholds have 24 bits: the rank of the pixel, and below it an
/// offset that goes through 1024 places from layer to layer, so that fractions finer than a tile can show come out right
/// over the layers.
/// image   levels: zones of different doses, or fill fractions of voxels
/// drops   a pixel of each level, [0] for level 0 is not read; each at most kMaxDrops
/// layer   its number: the same for the same job
/// cost    O(runs + changes of the result), and once a level and layer O(tile)
void dither(const LevelsView& image, std::span<const Drops24> drops, std::uint32_t layer, DitherScratch& scratch,
            Levels& result);

/// The same of at most one drop a pixel, as the image of those that get it.
/// drops  each at most kOneDrop
/// cost   as dither(); no branch waits for a level, a length or a pattern
void dither_one(const LevelsView& image, std::span<const Drops24> drops, std::uint32_t layer, DitherScratch& scratch,
                Runs& result);

/// The thresholds of a layer, for stretches of pixels that each have a number of drops of their own: the same drops as those
/// of dither(). Scratch; keeps its capacity.
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

/// Whether a pixel of a core is jetted: the fractional part of a c + b r + g l is below the share, where a, b and g are
/// (sqrt 5 - 1) / 2, (sqrt 13 - 3) / 2 and sqrt 2 - 1 as whole 32-bit fractions. Their continued fractions are all ones,
/// threes and twos, so that along columns, along rows and from layer to layer the set pixels of every line are the target
/// share, evenly spread, and no streak forms in any of the three directions.
/// source  Niederreiter, "Random Number Generation and Quasi-Monte Carlo Methods" (1992), section 3.1
constexpr bool core_pixel(std::uint32_t column, std::uint32_t row, std::uint32_t layer, std::uint32_t threshold) {
  return column * 2'654'435'769u + row * 1'300'411'463u + layer * 1'779'033'705u < threshold;
}

/// The threshold of a share in [0, 1).
inline std::uint32_t core_threshold(double share) {
  return static_cast<std::uint32_t>(std::clamp(std::llround(share * 4294967296.0), 0ll, 4294967295ll));
}

/// Full binder in the shell, a share of it in the core.
/// core    of the same size as the image and within it
/// layer   number of the layer: patterns differ from layer to layer, and are the same for the same job
/// result  the image without the pixels of the core that the pattern leaves out
/// cost    O(changes + pixels of the core)
void saturate(const RunsView& image, const RunsView& core, double share, std::uint32_t layer, Runs& result);

}  // namespace lamina::dose
