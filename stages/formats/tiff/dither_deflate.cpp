#include "stages/formats/tiff/dither_deflate.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cstring>

#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina::formats::tiff {
namespace {

using png::BitString;
using png::BitWriter;

constexpr std::size_t kMaxCode = 15;
constexpr std::size_t kTile = 16, kCore = 18, kWindow = 32'768;
/// Rows up and bytes to the left at which a core nearly repeats: one of 300 bytes differs, of 120; of 85, of 50. Where a core
/// begins, what repeats is to the right of it, and where it ends, to the left.
struct RowsBack {
  std::size_t rows;
  std::ptrdiff_t bytes;
};
constexpr RowsBack kBack[][2] = {{{20, 1}, {9, 13}}, {{11, -12}, {2, -25}}};
constexpr std::size_t kLane = 32;  // bytes that sums are made of at a time
static_assert(std::endian::native == std::endian::little);

std::uint64_t word_at(const std::byte* at) {
  std::uint64_t word = 0;
  std::memcpy(&word, at, sizeof word);
  return word;
}

/// The first byte from `at` on that is not the one `distance` before it, or, if all before `part` are, one of the next 8.
const std::byte* repeats_end(const std::byte* at, const std::byte* part, const std::byte* end, std::size_t distance) {
  for (; at < part && end - at >= 8; at += 8) {
    const std::uint64_t differs = word_at(at) ^ word_at(at - distance);
    if (differs != 0) return at + std::countr_zero(differs) / 8;
  }
  while (at < part && *at == *(at - distance)) ++at;
  return at;
}

struct AdlerSums {
  std::uint64_t bytes = 0, rows = 0, weighted = 0;  // rows: for each lane the sum of all bytes before it
};
/// weighted  the bytes of a lane times 32, 31, ... 1
AdlerSums lanes_plain(const std::uint8_t* at, std::size_t lanes) {
  AdlerSums sums;
  for (; lanes > 0; --lanes, at += kLane) {
    sums.rows += sums.bytes;
    for (std::size_t i = 0; i < kLane; ++i) sums.bytes += at[i], sums.weighted += (kLane - i) * at[i];
  }
  return sums;
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 std::uint64_t sum_of(__m256i of) {
  const __m128i half = _mm_add_epi64(_mm256_castsi256_si128(of), _mm256_extracti128_si256(of, 1));
  return static_cast<std::uint64_t>(_mm_cvtsi128_si64(half)) + static_cast<std::uint64_t>(_mm_extract_epi64(half, 1));
}
LAMINA_AVX2 AdlerSums lanes_avx2(const std::uint8_t* at, std::size_t lanes) {
  const __m256i zero = _mm256_setzero_si256(), ones = _mm256_set1_epi16(1);
  const __m256i weights = _mm256_setr_epi8(32, 31, 30, 29, 28, 27, 26, 25, 24, 23, 22, 21, 20, 19, 18, 17, 16, 15, 14, 13, 12, 11,
                                           10, 9, 8, 7, 6, 5, 4, 3, 2, 1);
  __m256i bytes = zero, rows = zero, weighted = zero;
  for (; lanes > 0; --lanes, at += kLane) {
    const __m256i here = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at));
    rows = _mm256_add_epi64(rows, bytes);
    bytes = _mm256_add_epi64(bytes, _mm256_sad_epu8(here, zero));
    weighted = _mm256_add_epi32(weighted, _mm256_madd_epi16(_mm256_maddubs_epi16(here, weights), ones));
  }
  weighted = _mm256_add_epi64(_mm256_unpacklo_epi32(weighted, zero), _mm256_unpackhi_epi32(weighted, zero));
  return {sum_of(bytes), sum_of(rows), sum_of(weighted)};
}
#endif
auto lanes_kernel() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() >= Isa::kAvx2) return lanes_avx2;
#endif
  return lanes_plain;
}

/// As png::word_lengths() of at most 15 bits: weights are flattened until that is so.
std::array<std::uint8_t, png::kSymbols> code_lengths(std::array<std::uint32_t, png::kSymbols> weights) {
  while (true) {
    const auto lengths = png::word_lengths(weights);
    if (*std::ranges::max_element(lengths) <= kMaxCode) return lengths;
    for (std::uint32_t& weight : weights) weight = (weight + 1) / 2 + 1;
  }
}

/// Of RFC 1950: a sum of bytes, and the sum of its values on the way, both modulo 65521. parts  outside of them bytes are 0
std::uint32_t adler_of(std::span<const std::byte> bytes, std::span<const RowSpan> parts) {
  constexpr std::uint64_t kModulus = 65'521;
  constexpr std::size_t kMaxLanes = 4096;  // sums of a lane fit 32 bits
  const auto* const data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  const auto kernel = lanes_kernel();
  std::uint64_t sum = 1, sums = 0;
  std::size_t at = 0;
  for (const RowSpan& part : parts) {
    sums += (part.begin - at) * sum;
    for (at = part.begin; part.end - at >= kLane;) {
      const std::size_t lanes = std::min((part.end - at) / kLane, kMaxLanes);
      const AdlerSums of = kernel(data + at, lanes);
      sums = (sums + kLane * (lanes * sum + of.rows) + of.weighted) % kModulus;
      sum = (sum + of.bytes) % kModulus;
      at += lanes * kLane;
    }
    for (; at < part.end; ++at) sums += sum += data[at];
    sum %= kModulus, sums %= kModulus;
  }
  sums += (bytes.size() - at) * sum;
  return static_cast<std::uint32_t>(sums % kModulus << 16 | sum % kModulus);
}

}  // namespace

/// Parts of the bytes outside of which all are 0 and repeat; whole lanes where they do not end with the bytes.
void DitherDeflate::find_parts(std::size_t size, std::span<const RowSpan> set) {
  parts_.clear();
  for (const RowSpan& of : set) {
    if (of.begin >= of.end) continue;
    std::size_t begin = of.begin;
    if (!parts_.empty() && parts_.back().end >= begin) {
      if (parts_.back().end >= of.end + kCore) continue;
      begin = parts_.back().begin;
      parts_.pop_back();
    }
    const std::size_t lanes = (of.end + kCore - begin + kLane - 1) / kLane;
    parts_.push_back({begin, std::min(size, begin + lanes * kLane)});
  }
}

/// Distances of a strip. The pattern of a core nearly repeats after 18 bytes: 144 is a Fibonacci number, whose multiple of the
/// golden ratio is almost whole (dose/dither.h). With some rows its multiples come nearer. Words of some places vote
/// whether it is a core.
void DitherDeflate::choose_distances(std::span<const std::byte> bytes, std::size_t stride) {
  constexpr std::size_t kStep = 40;
  std::size_t tile = 0, core = 0, at = kStep;
  for (const RowSpan& part : parts_) {
    at = std::max(at, (part.begin + kStep - 8) / kStep * kStep);  // words outside of the parts have no vote
    for (; at < part.end && at + 8 <= bytes.size(); at += kStep) {
      const std::uint64_t word = word_at(bytes.data() + at);
      const bool as_tile = word == word_at(bytes.data() + at - kTile), as_core = word == word_at(bytes.data() + at - kCore);
      tile += as_tile && !as_core, core += as_core && !as_tile;
    }
  }
  distances_ = 0;
  if (core <= 2 * tile) return add_distance(kTile);
  add_distance(kCore);
  for (const auto& choices : kBack) {
    for (const RowsBack& of : choices) {
      const std::size_t distance = of.rows * stride + static_cast<std::size_t>(of.bytes);  // of small rows: very large
      if (distance <= kCore || distance > kWindow) continue;
      add_distance(distance);
      break;
    }
  }
}

/// As deflate states it (RFC 1951, 3.2.5), unless another one has its symbol.
void DitherDeflate::add_distance(std::size_t bytes) {
  const auto less = static_cast<std::uint32_t>(bytes - 1);
  const auto extra_bits = static_cast<std::uint32_t>(std::bit_width(less)) - 2;
  const std::uint32_t symbol = 2 * extra_bits + (less >> extra_bits);
  const auto others = std::span(distance_).first(distances_);
  if (std::ranges::find(others, symbol, &DitherDistance::symbol) != others.end()) return;
  distance_[distances_++] = {bytes, symbol, less & ((1u << extra_bits) - 1), extra_bits, {}};
}

/// The longest of the matches that begin at `at`; of one that is long enough no other distance is compared.
/// part  the first that ends after `at`, as far as the caller knows; moves on
DitherDeflate::DitherMatch DitherDeflate::longest_match(std::span<const std::byte> bytes, const std::byte* at,
                                                  std::size_t& part) const {
  constexpr std::ptrdiff_t kLongEnough = 64;
  const std::byte *const data = bytes.data(), *const end = data + bytes.size();
  DitherMatch longest{at, 0};
  for (const std::byte* stop = at;;) {
    while (part < parts_.size() && data + parts_[part].end <= stop) ++part;
    if (part == parts_.size()) return {end, 0};
    const std::byte* const part_end = data + parts_[part].end;
    longest.end = stop = repeats_end(std::max(stop, data + parts_[part].begin), part_end, end, distance_[0].bytes);
    if (stop < part_end) break;
  }
  for (std::uint32_t d = 1; d < distances_ && longest.end - at < kLongEnough; ++d) {
    if (at - data < static_cast<std::ptrdiff_t>(distance_[d].bytes)) continue;
    const std::byte* const stop = repeats_end(at, end, end, distance_[d].bytes);
    if (stop > longest.end) longest = {stop, d};
  }
  return longest;
}

/// Whether no distance repeats the 8 bytes at `at`.
bool DitherDeflate::is_new(std::span<const std::byte> bytes, const std::byte* at) const {
  for (const DitherDistance& distance : std::span(distance_).first(distances_)) {
    if (at - bytes.data() >= static_cast<std::ptrdiff_t>(distance.bytes) && word_at(at) == word_at(at - distance.bytes))
      return false;
  }
  return true;
}

void DitherDeflate::find_pieces(std::span<const std::byte> bytes) {
  pieces_.clear();
  std::array<std::array<std::uint32_t, 256>, 4> counts{};
  const std::byte* const end = bytes.data() + bytes.size();
  const std::byte *literals = bytes.data(), *at = literals + std::min(distance_[0].bytes, bytes.size());
  std::size_t part = 0;
  weights_.fill(1);
  while (true) {
    while (end - at >= 8 && is_new(bytes, at)) at += 8;
    if (end - at < 8) at = end;
    const DitherMatch match = longest_match(bytes, at, part);
    const auto distance = static_cast<std::ptrdiff_t>(distance_[match.distance].bytes);
    const std::byte* begin = at;
    if (match.end > at) {
      while (begin > literals && begin - bytes.data() > distance && *(begin - 1) == *(begin - 1 - distance)) --begin;
    }
    const auto length = static_cast<std::uint32_t>(match.end - begin);
    pieces_.push_back({static_cast<std::uint32_t>(begin - literals), length, match.distance});
    const std::byte* literal = literals;
    for (; begin - literal >= 4; literal += 4) {
      for (std::size_t i = 0; i < 4; ++i) ++counts[i][static_cast<std::uint8_t>(literal[i])];
    }
    for (; literal < begin; ++literal) ++counts[0][static_cast<std::uint8_t>(*literal)];
    if (length > 0) {
      weights_[285] += length / png::kLongestMatch;
      const std::uint32_t rest = length % png::kLongestMatch;
      if (rest >= png::kShortestMatch) ++weights_[png::length_class(rest).symbol];
    }
    literals = at = match.end;
    if (at == end) break;
  }
  for (std::size_t b = 0; b < 256; ++b) weights_[b] += counts[0][b] + counts[1][b] + counts[2][b] + counts[3][b];
}

void DitherDeflate::make_code() {
  lengths_ = code_lengths(weights_);
  const auto words = png::words_of(lengths_);
  for (std::size_t b = 0; b < 256; ++b) byte_[b] = words[b];
  end_ = words[png::kEndOfBlock];
  // Distances have the words 0; 0 and 1; or 0, 10 and 11: those of lower symbols come first.
  std::array<std::uint8_t, kDistanceSymbols> of_distance{};
  for (std::size_t d = 0; d < distances_; ++d) of_distance[distance_[d].symbol] = d == 0 || distances_ == 2 ? 1 : 2;
  distance_lengths_ = of_distance;
  const auto backs = png::words_of(of_distance);
  for (DitherDistance& of : std::span(distance_).first(distances_))
    of.word = join(backs[of.symbol], BitString(of.extra, of.extra_bits));
  for (std::uint32_t length = png::kShortestMatch; length <= png::kLongestMatch; ++length) {
    const png::LengthClass found = png::length_class(length);
    match_[length] = join(words[found.symbol], BitString(found.extra, found.extra_bits));
  }
}

/// One block, which states its code (RFC 1951, 3.2.7): lengths of all symbols and of distances, without repeats.
void DitherDeflate::put_head(BitWriter& writer) const {
  constexpr std::size_t kLengthSymbols = 19;
  std::array<std::uint32_t, kLengthSymbols> weights{};
  for (const std::uint8_t length : lengths_) ++weights[length];
  std::size_t last = kDistanceSymbols - 1;
  while (distance_lengths_[last] == 0) --last;
  const auto of_distances = std::span(distance_lengths_).first(last + 1);
  for (const std::uint8_t length : of_distances) ++weights[length];
  auto lengths = png::word_lengths(weights);
  while (*std::ranges::max_element(lengths) > 7) {
    for (std::uint32_t& weight : weights) weight = weight > 0 ? weight / 2 + 1 : 0;
    lengths = png::word_lengths(weights);
  }
  const auto words = png::words_of(lengths);
  constexpr std::array<std::uint8_t, kLengthSymbols> kOrder = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                               11, 4,  12, 3, 13, 2, 14, 1, 15};
  writer.put(BitString(1, 1));  // the last block
  writer.put(BitString(2, 2));  // which states its code
  writer.put(BitString(png::kSymbols - 257, 5));
  writer.put(BitString(last, 5));
  writer.put(BitString(kLengthSymbols - 4, 4));
  for (const std::uint8_t symbol : kOrder) writer.put(BitString(lengths[symbol], 3));
  for (const std::uint8_t length : lengths_) writer.put(words[length]);
  for (const std::uint8_t length : of_distances) writer.put(words[length]);
}

void DitherDeflate::put_pieces(std::span<const std::byte> bytes, BitWriter& writer) const {
  const std::byte* at = bytes.data();
  const auto word = [&](const std::byte* of) { return byte_[static_cast<std::uint8_t>(*of)]; };
  for (const Piece& piece : pieces_) {
    const std::byte* const end = at + piece.literals;
    for (; end - at >= 3; at += 3) writer.put(join(join(word(at), word(at + 1)), word(at + 2)));
    for (; at < end; ++at) writer.put(word(at));
    const BitString back = distance_[piece.distance].word, longest = join(match_[png::kLongestMatch], back);
    std::uint32_t left = piece.match;
    for (; left >= png::kLongestMatch; left -= png::kLongestMatch) writer.put(longest);
    if (left >= png::kShortestMatch) {
      writer.put(join(match_[left], back));
    } else {
      for (std::uint32_t i = 0; i < left; ++i) writer.put(word(at + piece.match - left + i));
    }
    at += piece.match;
  }
}

std::size_t DitherDeflate::compress(std::span<const std::byte> bytes, std::size_t stride, std::span<const RowSpan> set,
                                    std::byte* out) {
  find_parts(bytes.size(), set);
  choose_distances(bytes, stride);
  find_pieces(bytes);
  make_code();
  out[0] = std::byte{0x78};  // a window of 32 KiB
  out[1] = std::byte{0x01};
  BitWriter writer(out + 2);
  put_head(writer);
  put_pieces(bytes, writer);
  writer.put(end_);
  std::byte* end = writer.finish();
  const std::uint32_t check = adler_of(bytes, parts_);
  for (int shift = 24; shift >= 0; shift -= 8) *end++ = static_cast<std::byte>(check >> shift & 0xFF);
  return static_cast<std::size_t>(end - out);
}

}  // namespace lamina::formats::tiff
