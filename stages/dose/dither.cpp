#include "stages/dose/dither.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "stages/dose/blue_noise.h"
#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina::dose {
namespace {

constexpr std::uint32_t kWords = kTileSide / 64, kStride = kWords + 1;
static_assert(kWords == 2);
constexpr std::size_t kPadding = 16;  // changes behind the last one of a row that are written too
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

/// Which pixels of the tile get one drop more: bit c % 64 of word c / 64 for the image's columns c modulo the tile.
void make_extra(std::uint32_t fraction, std::uint32_t layer, DitherScratch::Extra& extra) {
  const std::vector<std::uint16_t>& rank = blue_noise_ranks();
  const TileShift shift = tile_shift(layer);
  // A threshold is rank x 2^kBelowRank + offset: it is below the fraction where the rank is below this.
  const std::uint32_t offset = offset_of(layer);
  const std::uint32_t limit = fraction <= offset ? 0 : (fraction - offset + (1u << kBelowRank) - 1) >> kBelowRank;
  extra.bits.resize(std::size_t{kTileSide} * kStride);
  for (std::uint32_t row = 0; row < kTileSide; ++row) {
    const std::uint16_t* line = rank.data() + (row + shift.row) % kTileSide * kTileSide;
    const std::uint64_t first = below(line, limit), second = below(line + 64, limit);
    const bool turned = shift.column >= 64;
    const std::uint64_t low = turned ? second : first, high = turned ? first : second;
    const std::uint32_t by = shift.column % 64;
    std::uint64_t* bits = extra.bits.data() + row * kStride;
    bits[0] = bits[kWords] = low >> by | high << 1 << (63 - by);
    bits[1] = high >> by | low << 1 << (63 - by);
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

constexpr std::uint64_t kNoPixel[kStride] = {}, kAllPixels[kStride] = {~std::uint64_t{0}, ~std::uint64_t{0}, ~std::uint64_t{0}};

/// A row of levels, and what is taken of each.
struct RowTask {
  const std::uint32_t* change;
  const std::uint8_t* level;
  std::uint32_t runs;
  std::uint32_t row;
  const DitherScratch::Bits* of_level;
};

/// The places of the bits that are set in a byte, from the lowest on.
struct SetBits {
  std::array<std::array<std::uint8_t, 8>, 256> position{};
  std::array<std::uint8_t, 256> count{};
};
constexpr SetBits kSetBits = [] {
  SetBits table;
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    for (std::uint8_t bit = 0; bit < 8; ++bit) {
      if ((byte >> bit & 1) != 0) table.position[byte][table.count[byte]++] = bit;
    }
  }
  return table;
}();
/// Write the columns `begin` + i of all bits i that are set, and up to kPadding more that do not count. return  one past the
/// last
std::uint32_t* put_columns(std::uint32_t* change, std::uint32_t begin, std::uint64_t bits) {
  for (; bits != 0; bits &= bits - 1) *change++ = begin + static_cast<std::uint32_t>(std::countr_zero(bits));
  return change;
}

#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 std::uint32_t* put_byte(std::uint32_t* change, std::uint32_t begin, std::uint64_t byte) {
  const __m128i position = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(kSetBits.position[byte].data()));
  const __m256i column = _mm256_add_epi32(_mm256_cvtepu8_epi32(position), _mm256_set1_epi32(static_cast<int>(begin)));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(change), column);
  return change + kSetBits.count[byte];
}
LAMINA_AVX2 std::uint32_t* put_columns_avx2(std::uint32_t* change, std::uint32_t begin, std::uint64_t bits) {
  change = put_byte(change, begin, bits & 255);
  change = put_byte(change, begin + 8, bits >> 8 & 255);
  for (begin += 16, bits >>= 16; bits != 0; bits >>= 8, begin += 8) change = put_byte(change, begin, bits & 255);
  return change;
}

LAMINA_AVX512_BEGIN
LAMINA_AVX512 std::uint32_t* put_columns_avx512(std::uint32_t* change, std::uint32_t begin, std::uint64_t bits) {
  const __m512i lane = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  do {
    const __m512i column = _mm512_add_epi32(lane, _mm512_set1_epi32(static_cast<int>(begin)));
    _mm512_storeu_si512(change, _mm512_maskz_compress_epi32(static_cast<__mmask16>(bits), column));
    change += std::popcount(bits & 0xFFFF);
    begin += 16;
    bits >>= 16;
  } while (bits != 0);
  return change;
}
LAMINA_AVX512_END
#endif

/// The columns where a row of dither_one() changes. A run's changes are those of its bits moved by one, the last pixel before
/// it among them; where it does not touch the run before, that one ends first. returns  one past the last change
template <class Put>
LAMINA_BODY std::uint32_t* row_body(const RowTask& task, std::uint32_t* change, Put put) {
  const std::uint32_t tile_row = task.row % kTileSide;
  std::uint64_t set = 0;  // the last pixel so far
  std::uint32_t end = 0;  // one past it
  for (std::uint32_t i = 0; i < task.runs; ++i) {
    const DitherScratch::Bits& of = task.of_level[task.level[i]];
    const std::uint64_t* const words = of.words + tile_row * of.stride;
    std::uint32_t at = task.change[2 * i];
    *change = end;
    const std::uint64_t ends = set & std::uint64_t{at != end};
    change += ends;
    set ^= ends;
    end = task.change[2 * i + 1];
    for (std::uint32_t left = std::min(end - at, of.maximum);; at += 64, left -= 64) {
      const std::uint32_t pixels = std::min(left, 64u);
      const std::uint64_t* const word = words + at / 64 % kWords;
      const std::uint64_t bits = word[0] >> (at % 64) | word[1] << 1 << (63 - at % 64);
      const std::uint64_t changes = (bits ^ (bits << 1 | set)) & ~std::uint64_t{0} >> (64 - pixels);
      set = bits >> (pixels - 1) & 1;
      change = put(change, at, changes);
      if (left <= 64) break;
    }
  }
  *change = end;
  return change + set;
}

std::uint32_t* put_row(const RowTask& task, std::uint32_t* change) { return row_body(task, change, put_columns); }
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 std::uint32_t* put_row_avx2(const RowTask& task, std::uint32_t* change) {
  return row_body(task, change, put_columns_avx2);
}
LAMINA_AVX512 std::uint32_t* put_row_avx512(const RowTask& task, std::uint32_t* change) {
  return row_body(task, change, put_columns_avx512);
}
#endif

auto row_kernel() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() == Isa::kAvx512) return put_row_avx512;
  if (widest_isa() == Isa::kAvx2) return put_row_avx2;
#endif
  return put_row;
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
      const std::uint64_t* bits = extra.bits.data() + std::size_t{row % kTileSide} * kStride;
      append_dithered(image.change[2 * i], image.change[2 * i + 1], base, bits, result);
    }
    result.end_row();
  }
}

void dither_one(const LevelsView& image, std::span<const Drops24> drops, std::uint32_t layer, DitherScratch& scratch,
                Runs& result) {
  scratch.of_level.resize(drops.size());
  scratch.bits_of.clear();
  for (std::size_t level = 0; level < drops.size(); ++level) {
    const Drops24 of = level == 0 ? 0 : drops[level];
    if (of % kOneDrop == 0) {
      scratch.bits_of.push_back({of == 0 ? kNoPixel : kAllPixels, 0, 1});
      continue;
    }
    make_extra(static_cast<std::uint32_t>(of), layer, scratch.of_level[level]);
    scratch.bits_of.push_back({scratch.of_level[level].bits.data(), kStride, UINT32_MAX});
  }
  const std::uint32_t rows = image.rows();
  result.columns = image.columns;
  result.row_offset.resize(std::size_t{rows} + 1);
  result.row_offset[0] = 0;
  const auto kernel = row_kernel();
  std::size_t used = 0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    if (image.row_offset[row] != image.row_offset[row + 1]) {
      const std::size_t maximum = used + image.columns + kPadding;
      if (result.change.size() < maximum) result.change.resize(std::max(maximum, result.change.capacity()));
      const std::uint32_t first = image.row_offset[row];
      const RowTask task{image.change.data() + 2 * std::size_t{first}, image.level.data() + first,
                         image.row_offset[row + 1] - first, row, scratch.bits_of.data()};
      used = static_cast<std::size_t>(kernel(task, result.change.data() + used) - result.change.data());
    }
    result.row_offset[row + 1] = static_cast<std::uint32_t>(used);
  }
  result.change.resize(used);
}

void saturate(const RunsView& image, const RunsView& core, double share, std::uint32_t layer, Runs& result) {
  const std::uint32_t threshold = core_threshold(share);
  const std::uint32_t rows = image.rows();
  result.columns = image.columns;
  result.row_offset.resize(std::size_t{rows} + 1);
  result.change.clear();
  for (std::uint32_t r = 0; r < rows; ++r) {
    result.row_offset[r] = static_cast<std::uint32_t>(result.change.size());
    const auto inner = core.row(r);
    std::size_t k = 0;
    const auto row = image.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      std::uint32_t at = row[i];
      bool set = false;
      const auto become = [&](bool now) {
        if (now != set) result.change.push_back(at);
        set = now;
      };
      while (at < row[i + 1]) {
        while (k + 1 < inner.size() && inner[k + 1] <= at) k += 2;
        const bool in_core = k + 1 < inner.size() && inner[k] <= at;
        const std::uint32_t end = std::min(row[i + 1], in_core ? inner[k + 1] : k + 1 < inner.size() ? inner[k] : row[i + 1]);
        if (!in_core) {
          become(true);
          at = end;
          continue;
        }
        for (; at < end; ++at) become(core_pixel(at, r, layer, threshold));
      }
      become(false);
    }
  }
  result.row_offset[rows] = static_cast<std::uint32_t>(result.change.size());
}

}  // namespace lamina::dose
