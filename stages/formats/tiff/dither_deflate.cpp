#include "stages/formats/tiff/dither_deflate.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cstring>
#include <functional>

#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina::formats::tiff {
namespace {

constexpr std::size_t kTile = 16, kCore = 18, kWindow = 32'768;
/// Rows up and bytes to the left at which a core nearly repeats: one of 300 bytes differs, of 120; of 85, of 50. Where a core
/// begins, what repeats is to the right of it, and where it ends, to the left.
struct RowsBack {
  std::size_t rows;
  std::ptrdiff_t bytes;
};
constexpr RowsBack kBack[][2] = {{{20, 1}, {9, 13}}, {{11, -12}, {2, -25}}};
constexpr std::size_t kNear = 512;  // parts that are nearer are one
constexpr std::size_t kLane = 32;   // bytes that sums are made of at a time
static_assert(std::endian::native == std::endian::little);

std::uint64_t word_at(const std::byte* at) {
  std::uint64_t word = 0;
  std::memcpy(&word, at, sizeof word);
  return word;
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
  const __m256i weights = _mm256_setr_epi8(32, 31, 30, 29, 28, 27, 26, 25, 24, 23, 22, 21, 20, 19, 18, 17, 16, 15, 14, 13, 12,
                                           11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1);
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

/// Literals that are few are counted and put without a branch: their numbers vary.
bool is_short(const StripPiece& piece) {
  return piece.literals <= StripCode::kFew && piece.match >= png::kShortestMatch && piece.match <= png::kLongestMatch;
}

LAMINA_BODY void count_body(std::span<const StripPiece> pieces, const std::byte* at, StripWeights& weights) {
  std::array<std::array<std::array<std::uint32_t, 512>, 2>, 2> counts{};  // increments of one number do not follow each other
  std::size_t odd = 0;
  for (const StripPiece& piece : pieces) {
    auto& of = counts[odd ^= 1];
    if (is_short(piece)) {
      ++of[0][StripCode::index_of(at, 0, piece.literals)], ++of[1][StripCode::index_of(at, 1, piece.literals)];
    } else {
      for (std::size_t i = 0; i < piece.literals; ++i) ++of[i % 2][static_cast<std::size_t>(at[i])];
    }
    count_match(piece.match, weights);
    at += piece.literals + piece.match;
  }
  for (const auto& half : counts) {
    for (const auto& of : half)
      std::transform(weights.begin(), weights.begin() + 256, of.begin(), weights.begin(), std::plus());
  }
}

LAMINA_BODY void put_body(std::span<const StripPiece> pieces, const std::byte* at, const StripCode& code,
                          png::BitWriter& writer) {
  png::BitWriter fast = writer;  // its address is unknown elsewhere
  for (const StripPiece& piece : pieces) {
    if (is_short(piece)) {
      code.put_few(at, piece.literals, piece.match, piece.distance, fast);
      at += piece.literals + piece.match;
      continue;
    }
    writer = fast;
    code.put(at, piece.literals, writer);
    at += piece.literals + piece.match;
    const std::uint32_t rest = code.put_match(piece.match, piece.distance, writer);
    code.put(at - rest, rest, writer);
    fast = writer;
  }
  writer = fast;
}

struct PieceKernels {
  void (*count)(std::span<const StripPiece>, const std::byte*, StripWeights&);
  void (*put)(std::span<const StripPiece>, const std::byte*, const StripCode&, png::BitWriter&);
};
void count_plain(std::span<const StripPiece> pieces, const std::byte* at, StripWeights& weights) {
  count_body(pieces, at, weights);
}
void put_plain(std::span<const StripPiece> pieces, const std::byte* at, const StripCode& code, png::BitWriter& writer) {
  put_body(pieces, at, code, writer);
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 void count_avx2(std::span<const StripPiece> pieces, const std::byte* at, StripWeights& weights) {
  count_body(pieces, at, weights);
}
LAMINA_AVX2 void put_avx2(std::span<const StripPiece> pieces, const std::byte* at, const StripCode& code,
                          png::BitWriter& writer) {
  put_body(pieces, at, code, writer);
}
#endif
PieceKernels piece_kernels() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() >= Isa::kAvx2) return {count_avx2, put_avx2};
#endif
  return {count_plain, put_plain};
}

}  // namespace

std::size_t DitherDeflate::compress_rows(RowBits& image, std::uint32_t begin, std::uint32_t end, std::size_t stride,
                                         std::byte* out) {
  const std::size_t size = stride * (end - begin);
  if (strip_.size() < size) strip_.assign(size, std::byte{0});
  set_.clear();
  for (std::uint32_t row = begin; row < end; ++row) {
    const std::size_t at = stride * (row - begin), before = set_.size();
    image.put_set(row, std::span(strip_).subspan(at, stride), set_);
    for (RowSpan& set : std::span(set_).subspan(before)) set.begin += at, set.end += at;
  }
  const auto strip = std::span(strip_).first(size);
  const std::size_t length = compress(strip, stride, set_, out);
  for (const RowSpan& set : set_) std::memset(strip.data() + set.begin, 0, set.end - set.begin);
  return length;
}

/// Parts of the bytes outside of which all are 0, as are some before and after each; whole lanes where they do not end with the
/// bytes.
void DitherDeflate::find_parts(std::size_t size, std::span<const RowSpan> set) {
  parts_.clear();
  for (const RowSpan& of : set) {
    if (of.begin >= of.end) continue;
    std::size_t begin = of.begin > 2 * kLane ? of.begin - kLane : 0;
    if (!parts_.empty() && parts_.back().end + kNear >= begin) {
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
  constexpr std::size_t kStep = 40, kVotes = 256;
  std::size_t tile = 0, core = 0, at = kStep;
  for (const RowSpan& part : parts_) {
    at = std::max(at, (part.begin + kStep - 8) / kStep * kStep);  // words outside of the parts have no vote
    for (; at < part.end && at + 8 <= bytes.size() && tile + core < kVotes; at += kStep) {
      const std::uint64_t word = word_at(bytes.data() + at);
      const bool as_tile = word == word_at(bytes.data() + at - kTile), as_core = word == word_at(bytes.data() + at - kCore);
      tile += as_tile && !as_core, core += as_core && !as_tile;
    }
  }
  code_.clear_distances();
  code_.add_distance(1);
  if (core <= 2 * tile) return code_.add_distance(kTile);
  for (const auto& choices : kBack) {
    for (const RowsBack& of : choices) {
      const std::size_t distance = of.rows * stride + static_cast<std::size_t>(of.bytes);  // of small rows: very large
      if (distance <= kCore || distance > kWindow) continue;
      code_.add_distance(distance);
      break;
    }
  }
  code_.add_distance(kCore);
}

void DitherDeflate::find_pieces(std::span<const std::byte> bytes) {
  pieces_.clear();
  std::size_t literals = 0;
  const std::size_t first = parts_.empty() ? bytes.size() : parts_.front().begin;
  if (first > 1) pieces_.push_back({1, static_cast<std::uint32_t>(first - 1), 0}), literals = first;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    literals = matches_.add({bytes, code_.distances(), parts_[p].begin, parts_[p].end}, literals, pieces_);
    const std::size_t next = p + 1 < parts_.size() ? parts_[p + 1].begin : bytes.size();
    if (next > parts_[p].end) pieces_.back().match += static_cast<std::uint32_t>(next - parts_[p].end), literals = next;
  }
  pieces_.push_back({static_cast<std::uint32_t>(bytes.size() - literals), 0, 0});
}

std::size_t DitherDeflate::compress(std::span<const std::byte> bytes, std::size_t stride, std::span<const RowSpan> set,
                                    std::byte* out) {
  find_parts(bytes.size(), set);
  choose_distances(bytes, stride);
  find_pieces(bytes);
  const PieceKernels kernels = piece_kernels();
  StripWeights weights;
  weights.fill(1);
  kernels.count(pieces_, bytes.data(), weights);
  code_.make(weights);
  png::BitWriter writer = code_.start(out);
  kernels.put(pieces_, bytes.data(), code_, writer);
  return static_cast<std::size_t>(code_.finish(adler_of(bytes, parts_), writer) - out);
}

}  // namespace lamina::formats::tiff
