#include "stages/dose/dither.h"

#include <algorithm>
#include <bit>

#include "stages/dose/blue_noise.h"

namespace lamina::dose {
namespace {

constexpr std::uint32_t kWords = kTileSide / 64;
constexpr unsigned kRankBits = 14, kBelowRank = kDropBits - kRankBits;
static_assert(1u << kRankBits == kTilePixels);

/// The low bits of a threshold in a layer: those of its number in reverse order.
std::uint32_t offset_of(std::uint32_t layer) {
  std::uint32_t offset = 0;
  for (unsigned bit = 0; bit < kBelowRank; ++bit) offset |= (layer >> bit & 1u) << (kBelowRank - 1 - bit);
  return offset;
}

/// Which pixels of the tile get one drop more: bit c % 64 of word c / 64 for the image's columns c modulo the tile.
void make_extra(std::uint32_t fraction, std::uint32_t layer, DitherScratch::Extra& extra) {
  const std::vector<std::uint16_t>& rank = blue_noise_ranks();
  const TileShift shift = tile_shift(layer);
  const std::uint32_t offset = offset_of(layer);
  extra.bits.assign(std::size_t{kTileSide} * kWords, 0);
  for (std::uint32_t row = 0; row < kTileSide; ++row) {
    const std::uint16_t* line = rank.data() + (row + shift.row) % kTileSide * kTileSide;
    for (std::uint32_t column = 0; column < kTileSide; ++column) {
      const std::uint32_t threshold = (std::uint32_t{line[(column + shift.column) % kTileSide]} << kBelowRank) + offset;
      if (threshold < fraction) extra.bits[row * kWords + column / 64] |= std::uint64_t{1} << (column % 64);
    }
  }
  extra.made = true;
}

/// Appends [begin, end) with `base` drops a pixel, and one more where a bit is set.
void append_dithered(std::uint32_t begin, std::uint32_t end, std::uint8_t base, const std::uint64_t* bits, Levels& result) {
  while (begin < end) {
    const std::uint64_t left = bits[begin / 64 % kWords] >> (begin % 64);
    const bool more = (left & 1) != 0;
    const auto same = static_cast<std::uint32_t>(more ? std::countr_one(left) : std::countr_zero(left));
    const std::uint32_t stop = std::min({end, begin + same, (begin / 64 + 1) * 64});
    result.append(begin, stop, static_cast<std::uint8_t>(base + (more ? 1 : 0)));
    begin = stop;
  }
}

}  // namespace

void Thresholds::start(std::uint32_t layer) {
  const std::vector<std::uint16_t>& rank = blue_noise_ranks();
  const TileShift shift = tile_shift(layer);
  const std::uint32_t offset = offset_of(layer);
  of_tile_.resize(kTilePixels);
  for (std::uint32_t row = 0; row < kTileSide; ++row) {
    const std::uint16_t* line = rank.data() + (row + shift.row) % kTileSide * kTileSide;
    std::uint32_t* turned = of_tile_.data() + std::size_t{row} * kTileSide;
    for (std::uint32_t column = 0; column < kTileSide; ++column)
      turned[column] = (std::uint32_t{line[(column + shift.column) % kTileSide]} << kBelowRank) + offset;
  }
}

void Thresholds::append(std::uint32_t begin, std::uint32_t end, std::uint32_t row, Drops24 drops, Levels& result) const {
  const auto base = static_cast<std::uint8_t>(drops >> kDropBits);
  const auto fraction = static_cast<std::uint32_t>(drops & (kOneDrop - 1));
  if (fraction == 0) return result.append(begin, end, base);
  const std::uint32_t* line = of_tile_.data() + std::size_t{row % kTileSide} * kTileSide;
  while (begin < end) {
    const bool more = line[begin % kTileSide] < fraction;
    std::uint32_t stop = begin + 1;
    while (stop < end && (line[stop % kTileSide] < fraction) == more) ++stop;
    result.append(begin, stop, static_cast<std::uint8_t>(base + (more ? 1 : 0)));
    begin = stop;
  }
}

void dither(const LevelsView& image, std::span<const Drops24> drops, std::uint32_t layer, DitherScratch& scratch,
            Levels& result) {
  scratch.of_level.resize(drops.size());
  for (DitherScratch::Extra& extra : scratch.of_level) extra.made = false;
  result.start(image.columns);
  for (std::uint32_t row = 0; row < image.rows(); ++row) {
    for (std::uint32_t i = image.row_offset[row]; i < image.row_offset[row + 1]; ++i) {
      const std::uint8_t level = image.level[i];
      const auto base = static_cast<std::uint8_t>(drops[level] >> kDropBits);
      const auto fraction = static_cast<std::uint32_t>(drops[level] & (kOneDrop - 1));
      if (fraction == 0) {
        result.append(image.change[2 * i], image.change[2 * i + 1], base);
        continue;
      }
      DitherScratch::Extra& extra = scratch.of_level[level];
      if (!extra.made) make_extra(fraction, layer, extra);
      const std::uint64_t* bits = extra.bits.data() + std::size_t{row % kTileSide} * kWords;
      append_dithered(image.change[2 * i], image.change[2 * i + 1], base, bits, result);
    }
    result.end_row();
  }
}

}  // namespace lamina::dose
