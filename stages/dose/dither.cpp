#include "stages/dose/dither.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "stages/dose/blue_noise.h"
#include "stages/geometry/drop_rows.h"

namespace lamina::dose {
namespace {

constexpr unsigned kRankBits = 14, kBelowRank = kDropBits - kRankBits;
static_assert(1u << kRankBits == kTilePixels);

/// The low bits of a threshold in a layer: those of its number in reverse order.
std::uint32_t offset_of(std::uint32_t layer) {
  std::uint32_t offset = 0;
  for (unsigned bit = 0; bit < kBelowRank; ++bit) offset |= (layer >> bit & 1u) << (kBelowRank - 1 - bit);
  return offset;
}

/// Bit i: whether the rank of the pixel i of 64 is below the limit.
std::uint64_t below(const std::uint16_t* rank, std::uint32_t limit) {
  std::array<std::uint8_t, 64> is_below;
  for (std::uint32_t i = 0; i < 64; ++i) is_below[i] = rank[i] < limit ? 1 : 0;
  std::uint64_t bits = 0;
  for (std::uint32_t i = 0; i < 64; i += 8) {
    std::uint64_t eight;
    std::memcpy(&eight, is_below.data() + i, sizeof eight);
    if constexpr (std::endian::native == std::endian::big) eight = __builtin_bswap64(eight);
    bits |= eight * 0x0102'0408'1020'4080u >> 56 << i;  // byte k becomes bit k of the last byte
  }
  return bits;
}

/// Which pixels of the tile get one drop more, turned to the layer's shift. bits  kTileWords
void make_tile(std::uint32_t fraction, std::uint32_t layer, std::uint64_t* bits) {
  const std::vector<std::uint16_t>& rank = blue_noise_ranks();
  const TileShift shift = tile_shift(layer);
  // A threshold is rank x 2^kBelowRank + offset: it is below the fraction where the rank is below this.
  const std::uint32_t offset = offset_of(layer);
  const std::uint32_t limit = fraction <= offset ? 0 : (fraction - offset + (1u << kBelowRank) - 1) >> kBelowRank;
  for (std::uint32_t row = 0; row < kTileSide; ++row) {
    const std::uint16_t* line = rank.data() + (row + shift.row) % kTileSide * kTileSide;
    const std::uint64_t first = below(line, limit), second = below(line + 64, limit);
    const bool turned = shift.column >= 64;
    const std::uint64_t low = turned ? second : first, high = turned ? first : second;
    const std::uint32_t by = shift.column % 64;
    bits[2 * row] = low >> by | high << 1 << (63 - by);
    bits[2 * row + 1] = high >> by | low << 1 << (63 - by);
  }
}

}  // namespace

void make_zones(std::span<const Drops24> drops, std::uint32_t layer, DropPatterns& result) {
  result.zone.assign(drops.size(), DropZone());
  result.edges_alone = false;
  std::size_t tiles = 0;
  for (std::size_t level = 1; level < drops.size(); ++level) {
    DropZone& zone = result.zone[level];
    zone.base = static_cast<std::uint8_t>(drops[level] >> kDropBits);
    const auto fraction = static_cast<std::uint32_t>(drops[level] & (kOneDrop - 1));
    if (fraction == 0) continue;
    zone.extra = DropZone::Extra::kTile;
    zone.tile = static_cast<std::uint8_t>(tiles++);
    result.tile.resize(tiles * kTileWords);
    make_tile(fraction, layer, result.tile.data() + zone.tile * std::size_t{kTileWords});
  }
  result.tile.resize(tiles * kTileWords);
}

void make_core(double share, std::uint32_t layer, DropPatterns& result) {
  result.tile.clear();
  result.edges_alone = false;
  CorePattern& core = result.core;
  core.column_step = 2'654'435'769u, core.row_step = 1'300'411'463u;
  core.first = layer * 1'779'033'705u, core.threshold = core_threshold(share);
  tabulate(core);
  const auto extra = core.threshold > 0 ? DropZone::Extra::kCore : DropZone::Extra::kNone;
  result.zone = {{}, {1, DropZone::Extra::kNone, 0}, {0, extra, 0}};
}

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

}  // namespace lamina::dose
