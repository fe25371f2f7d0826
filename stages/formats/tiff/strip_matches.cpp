#include "stages/formats/tiff/strip_matches.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <bit>

#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina::formats::tiff {
namespace {

constexpr std::size_t kBlock = 64;  // bytes of a word of a mask

/// Bit i: whether byte i of a block is that of the other one.
struct EqualPlain {
  static std::uint64_t of(const std::byte* a, const std::byte* b) {
    std::uint64_t equal = 0;
#if defined(__SSE2__)
    for (std::size_t i = 0; i < kBlock; i += 16) {
      const __m128i same = _mm_cmpeq_epi8(_mm_loadu_si128(reinterpret_cast<const __m128i*>(a + i)),
                                          _mm_loadu_si128(reinterpret_cast<const __m128i*>(b + i)));
      equal |= std::uint64_t{static_cast<std::uint32_t>(_mm_movemask_epi8(same))} << i;
    }
#else
    for (std::size_t i = 0; i < kBlock; ++i) equal |= std::uint64_t{a[i] == b[i]} << i;
#endif
    return equal;
  }
};
#if defined(LAMINA_WIDE_KERNELS)
struct EqualAvx2 {
  LAMINA_AVX2 static std::uint32_t half(const std::byte* a, const std::byte* b) {
    const __m256i equal = _mm256_cmpeq_epi8(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(a)),
                                            _mm256_loadu_si256(reinterpret_cast<const __m256i*>(b)));
    return static_cast<std::uint32_t>(_mm256_movemask_epi8(equal));
  }
  LAMINA_AVX2 static std::uint64_t of(const std::byte* a, const std::byte* b) {
    return half(a, b) | std::uint64_t{half(a + 32, b + 32)} << 32;
  }
};
LAMINA_AVX512_BEGIN
struct EqualAvx512 {
  LAMINA_AVX512 static std::uint64_t of(const std::byte* a, const std::byte* b) {
    return _mm512_cmpeq_epi8_mask(_mm512_loadu_si512(a), _mm512_loadu_si512(b));
  }
};
LAMINA_AVX512_END
#endif

/// 128 bits.
struct TwoWords {
  std::uint64_t low, high;
};
LAMINA_BODY TwoWords operator&(TwoWords a, TwoWords b) { return {a.low & b.low, a.high & b.high}; }
LAMINA_BODY TwoWords operator|(TwoWords a, TwoWords b) { return {a.low | b.low, a.high | b.high}; }
LAMINA_BODY TwoWords operator>>(TwoWords a, unsigned by) { return {a.low >> by | a.high << (64 - by), a.high >> by}; }
LAMINA_BODY TwoWords operator<<(TwoWords a, unsigned by) { return {a.low << by, a.high << by | a.low >> (64 - by)}; }

/// The bits at which runs of kRun bits begin, of the low word.
template <unsigned kRun>
LAMINA_BODY std::uint64_t run_starts(TwoWords bits) {
  if constexpr (kRun == 16) {
    bits = bits & bits >> 1;
    bits = bits & bits >> 2;
    bits = bits & bits >> 4;
    bits = bits & bits >> 8;
  } else {
    static_assert(kRun == 3 || kRun == 6);
    bits = bits & bits >> 1 & bits >> 2;
    if constexpr (kRun == 6) bits = bits & bits >> 3;
  }
  return bits.low;
}

/// The high word of these runs.
template <unsigned kRun>
LAMINA_BODY std::uint64_t run_bits(TwoWords starts) {
  if constexpr (kRun == 16) {
    starts = starts | starts << 1;
    starts = starts | starts << 2;
    starts = starts | starts << 4;
    starts = starts | starts << 8;
  } else {
    starts = starts | starts << 1 | starts << 2;
    if constexpr (kRun == 6) starts = starts | starts << 3;
  }
  return starts.high;
}

/// Masks of a part, of which each has an empty word before and after its own.
struct PartMasks {
  std::uint64_t* first;
  std::size_t words;
  enum Number : std::size_t {
    kFree,
    kStarts,
    kBegin,
    kEnd,
    kMatched,
    kEqual
  };  // bytes without a match; scratch; of all matches
  std::uint64_t* mask(std::size_t number) const { return first + number * (words + 2) + 1; }
  std::uint64_t* equal(std::size_t d) const { return mask(kEqual + d); }
  /// The first distance gets matches twice; others only once, when what is equal is read no more.
  std::uint64_t* matched(std::size_t d) const { return d == 0 ? mask(kMatched) : equal(d); }
  static std::size_t size(std::size_t words, std::size_t distances) { return (kEqual + distances) * (words + 2); }
};

template <class Equal>
LAMINA_BODY void find_equal(const StripPart& part, std::size_t distance, std::uint64_t* mask) {
  const std::byte* const data = part.strip.data();
  const std::size_t end = part.end;
  for (std::size_t at = part.begin; at < end; at += kBlock, ++mask) {
    if (at >= distance && at + kBlock <= end) {
      *mask = Equal::of(data + at, data + at - distance);
      continue;
    }
    *mask = 0;
    for (std::size_t i = std::max(at, distance); i < std::min(at + kBlock, end); ++i)
      *mask |= std::uint64_t{data[i] == data[i - distance]} << (i - at);
  }
}

template <unsigned kRun>
LAMINA_BODY void find_starts(const PartMasks& masks, const std::uint64_t* __restrict equal) {
  const std::uint64_t* __restrict free = masks.mask(PartMasks::kFree);
  std::uint64_t* __restrict starts = masks.mask(PartMasks::kStarts);
  for (std::size_t w = 0, words = masks.words; w < words; ++w)
    starts[w] = run_starts<kRun>({equal[w] & free[w], equal[w + 1] & free[w + 1]});
}

/// Gives a distance all runs of kRun bytes and more that repeat there and have no match yet.
template <unsigned kRun>
LAMINA_BODY void take_runs(const PartMasks& masks, std::size_t d, std::uint64_t kept = 0) {
  find_starts<kRun>(masks, masks.equal(d));
  const std::uint64_t* __restrict starts = masks.mask(PartMasks::kStarts);
  std::uint64_t* __restrict free = masks.mask(PartMasks::kFree), * __restrict matched = masks.matched(d);
  for (std::size_t w = 0, words = masks.words; w < words; ++w) {
    const std::uint64_t taken = run_bits<kRun>({starts[w - 1], starts[w]});
    matched[w] = (matched[w] & kept) | taken;
    free[w] &= ~taken;
  }
}

/// Adds the ends of a distance's matches to those of all.
LAMINA_BODY void add_ends(const PartMasks& masks, std::size_t d) {
  const std::uint64_t* __restrict matched = masks.matched(d);
  std::uint64_t* __restrict begin = masks.mask(PartMasks::kBegin), * __restrict end = masks.mask(PartMasks::kEnd);
  for (std::size_t w = 0, words = masks.words; w <= words; ++w) {
    const std::uint64_t here = matched[w], before = here << 1 | matched[w - 1] >> 63;
    begin[w] |= here & ~before, end[w] |= before & ~here;
  }
}

/// Puts the numbers of the bits of a mask. to  has 4 more. returns  how many they are
LAMINA_BODY std::size_t put_bits(const std::uint64_t* mask, std::size_t words, std::uint32_t* to) {
  constexpr std::uint64_t kLast = std::uint64_t{1} << 63;  // where no bit is left
  std::uint32_t* next = to;
  for (std::size_t w = 0; w < words; ++w) {
    std::uint64_t bits = mask[w];
    std::uint32_t* const end = next + std::popcount(bits);
    do {
      for (std::size_t i = 0; i < 4; ++i, bits &= bits - 1)
        next[i] = static_cast<std::uint32_t>(64 * w) + static_cast<std::uint32_t>(std::countr_zero(bits | kLast));
      next += 4;
    } while (next < end);
    next = end;
  }
  return static_cast<std::size_t>(next - to);
}

/// begin, end  of the matches; returns  their number
template <class Equal>
LAMINA_BODY std::size_t find_matches(const StripPart& part, const PartMasks& masks, std::uint32_t* begin, std::uint32_t* end) {
  const std::size_t count = part.distances.size();
  for (std::size_t d = 0; d < count; ++d) find_equal<Equal>(part, part.distances[d].bytes, masks.equal(d));
  take_runs<16>(masks, 0);  // what is empty or full
  for (std::size_t d = 1; d < count; ++d) part.distances[d].extra_bits > 8 ? take_runs<6>(masks, d) : take_runs<3>(masks, d);
  take_runs<3>(masks, 0, ~std::uint64_t{0});
  for (std::size_t d = 0; d < count; ++d) add_ends(masks, d);
  put_bits(masks.mask(PartMasks::kEnd), masks.words + 1, end);
  return put_bits(masks.mask(PartMasks::kBegin), masks.words, begin);
}
std::size_t matches_plain(const StripPart& part, const PartMasks& masks, std::uint32_t* begin, std::uint32_t* end) {
  return find_matches<EqualPlain>(part, masks, begin, end);
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 std::size_t matches_avx2(const StripPart& part, const PartMasks& masks, std::uint32_t* begin, std::uint32_t* end) {
  return find_matches<EqualAvx2>(part, masks, begin, end);
}
LAMINA_AVX512 std::size_t matches_avx512(const StripPart& part, const PartMasks& masks, std::uint32_t* begin,
                                         std::uint32_t* end) {
  return find_matches<EqualAvx512>(part, masks, begin, end);
}
#endif
auto matches_kernel() {
#if defined(LAMINA_WIDE_KERNELS)
  if (widest_isa() >= Isa::kAvx512) return matches_avx512;
  if (widest_isa() >= Isa::kAvx2) return matches_avx2;
#endif
  return matches_plain;
}

}  // namespace

std::size_t StripMatches::add(const StripPart& part, std::size_t literals, Buffer<StripPiece>& pieces) {
  const std::size_t length = part.end - part.begin, words = (length + kBlock - 1) / kBlock, count = part.distances.size();
  masks_.resize(PartMasks::size(words, count));
  const PartMasks masks{masks_.data(), words};
  for (std::size_t number = 0; number < PartMasks::kEqual + count; ++number)
    masks.mask(number)[-1] = masks.mask(number)[words] = 0;
  std::fill_n(masks.mask(PartMasks::kFree), words, ~std::uint64_t{0});
  for (const auto number : {PartMasks::kBegin, PartMasks::kEnd}) std::fill_n(masks.mask(number), words, 0);
  begin_.resize(length + 4), end_.resize(length + 4);
  const std::size_t matches = matches_kernel()(part, masks, begin_.data(), end_.data());
  std::size_t i = 0;
  if (matches > 0 && !pieces.empty() && pieces.back().distance == 0 && literals == part.begin + begin_[0] &&
      (*masks.matched(0) & 1) != 0)
    literals = part.begin + end_[0], pieces.back().match += end_[0], i = 1;
  const std::size_t before = pieces.size();
  pieces.resize(before + matches - i);
  for (StripPiece* piece = pieces.data() + before; i < matches; ++i, ++piece) {
    const std::uint32_t at = begin_[i];
    std::uint64_t distance = 0;
    for (std::size_t d = 1; d < count; ++d) distance += d * (masks.matched(d)[at / 64] >> at % 64 & 1);
    *piece = {static_cast<std::uint32_t>(part.begin + at - literals), end_[i] - at, static_cast<std::uint32_t>(distance)};
    literals = part.begin + end_[i];
  }
  return literals;
}

}  // namespace lamina::formats::tiff
