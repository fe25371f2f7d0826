// The order of triangles within a block, and one body for each instruction set.
//
// Heights are whole numbers, and so is their sum, which is below 2^44; the rest is rounded triangle by triangle.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "stages/geometry/blocks/kernels/kernels.h"

namespace lamina {
namespace {

using Four = Nm __attribute__((vector_size(16)));
using SixteenCounts = std::uint16_t __attribute__((vector_size(32)));
using FourHeights = std::uint32_t __attribute__((vector_size(16)));
using FourSums = std::uint64_t __attribute__((vector_size(32)));

constexpr std::uint32_t kFewValues = 1 << 13;  // 16 KiB of counts

/// The height of the middle of each facet and where its first corner lies, and what the order needs to know of all, nm.
struct Heights {
  std::array<Nm, kBlockSize> middle, y;
  Nm lowest = INT32_MAX, highest = INT32_MIN;  // of the middles
  Nm front = INT32_MAX, back = INT32_MIN;      // y of the first corners
  std::uint64_t sum = 0;                       // of the facets' own heights
};

LAMINA_BODY Nm minimum(const Four& v) { return std::min(std::min(v[0], v[1]), std::min(v[2], v[3])); }
LAMINA_BODY Nm maximum(const Four& v) { return std::max(std::max(v[0], v[1]), std::max(v[2], v[3])); }

LAMINA_BODY void see_one(const Triangle& t, std::uint32_t i, Heights& heights) {
  const Nm lo = std::min(t.a.z, std::min(t.b.z, t.c.z)), hi = std::max(t.a.z, std::max(t.b.z, t.c.z));
  heights.middle[i] = (lo >> 1) + (hi >> 1);
  heights.y[i] = t.a.y;
  heights.lowest = std::min(heights.lowest, heights.middle[i]);
  heights.highest = std::max(heights.highest, heights.middle[i]);
  heights.front = std::min(heights.front, t.a.y);
  heights.back = std::max(heights.back, t.a.y);
  heights.sum += static_cast<std::uint32_t>(hi) - static_cast<std::uint32_t>(lo);
}

LAMINA_BODY void see(std::span<const Triangle> block, Heights& heights) {
  Four lowest = {INT32_MAX, INT32_MAX, INT32_MAX, INT32_MAX}, highest = ~lowest, front = lowest, back = highest;
  FourSums sum = {};
  const auto count = static_cast<std::uint32_t>(block.size()), whole = count / 4 * 4;
  for (std::uint32_t i = 0; i < whole; i += 4) {
    Four early[4], late[4];  // numbers 1 to 4 and 5 to 8 of each triangle
    for (std::uint32_t k = 0; k < 4; ++k) {
      std::memcpy(&early[k], &block[i + k].a.y, sizeof(Four));
      std::memcpy(&late[k], &block[i + k].b.z, sizeof(Four));
    }
    const Four ab = __builtin_shufflevector(early[0], early[1], 0, 4, 1, 5),
               cd = __builtin_shufflevector(early[2], early[3], 0, 4, 1, 5);
    const Four late_ab = __builtin_shufflevector(late[0], late[1], 0, 4, 3, 7),
               late_cd = __builtin_shufflevector(late[2], late[3], 0, 4, 3, 7);
    const Four y = __builtin_shufflevector(ab, cd, 0, 1, 4, 5), za = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
    const Four zb = __builtin_shufflevector(late_ab, late_cd, 0, 1, 4, 5),
               zc = __builtin_shufflevector(late_ab, late_cd, 2, 3, 6, 7);
    const Four lower = za < zb ? za : zb, upper = za < zb ? zb : za;
    const Four lo = lower < zc ? lower : zc, hi = upper < zc ? zc : upper, middle = (lo >> 1) + (hi >> 1);
    std::memcpy(heights.middle.data() + i, &middle, sizeof middle);
    std::memcpy(heights.y.data() + i, &y, sizeof y);
    lowest = middle < lowest ? middle : lowest;
    highest = middle > highest ? middle : highest;
    front = y < front ? y : front;
    back = y > back ? y : back;
    sum += __builtin_convertvector((FourHeights)hi - (FourHeights)lo, FourSums);
  }
  heights.lowest = minimum(lowest), heights.highest = maximum(highest);
  heights.front = minimum(front), heights.back = maximum(back);
  heights.sum = sum[0] + sum[1] + sum[2] + sum[3];
  for (std::uint32_t i = whole; i < count; ++i) see_one(block[i], i, heights);
}

/// Where a triangle stands in the order of its block: by height in steps, then along y. 15 bits.
///
/// A job's planes and beams visit a cluster as often as its height times its depth says, the latter blurred by what a beam is
/// deep; how wide it is costs nothing. Of mean facets h high in a block H high and D deep, that is least at the step below.
struct BlockOrder {
  static constexpr std::int32_t kSteps = 1 << 9, kRows = 64;
  static constexpr double kBeam = 2e6;  // nm
  double lowest, front;
  float steps_a_nm, rows_a_nm;

  LAMINA_BODY BlockOrder(const Heights& heights, std::size_t count) : lowest(heights.lowest), front(heights.front) {
    const double height = heights.highest - lowest, depth = heights.back - front;
    const double mean = static_cast<double>(heights.sum) / static_cast<double>(count);
    const double clusters = static_cast<double>(count) / kClusterSize;
    const double step = std::max(std::sqrt(height * depth * mean / (clusters * kBeam)), mean / 4);
    steps_a_nm = static_cast<float>(1 / std::max(step, height / (kSteps - 2) + 1));
    rows_a_nm = static_cast<float>(kRows / (depth + 1));
  }

  /// Differences of whole numbers of 32 bits are exact in double.
  LAMINA_BODY std::int32_t key(Nm middle, Nm y) const {
    const auto step = static_cast<std::int32_t>(static_cast<float>(static_cast<double>(middle) - lowest) * steps_a_nm);
    const auto row = static_cast<std::int32_t>(static_cast<float>(static_cast<double>(y) - front) * rows_a_nm);
    return step << 6 | std::min(row, kRows - 1);
  }
};

/// Sorts by one byte, stably. Four quarters of the list are followed at once: equal bytes often follow each other, and each
/// waits for the place of the one before.
template <class Out>
LAMINA_BODY void sort_by_byte(const std::uint32_t* key, std::uint32_t count, std::uint32_t shift, Out* out) {
  constexpr std::uint32_t kQuarters = 4;
  std::uint16_t position[kQuarters][256] = {};
  const std::uint32_t quarter = count / kQuarters;
  const auto each = [&](auto&& visit) __attribute__((always_inline)) {
    for (std::uint32_t i = 0; i < quarter; ++i) {
      for (std::uint32_t q = 0; q < kQuarters; ++q) visit(position[q], key[q * quarter + i]);
    }
    for (std::uint32_t i = kQuarters * quarter; i < count; ++i) visit(position[kQuarters - 1], key[i]);
  };
  each([&](std::uint16_t* of, std::uint32_t one) { ++of[one >> shift & 255]; });
  std::uint16_t total = 0;
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    for (auto& of : position) {
      const std::uint16_t here = of[byte];
      of[byte] = total;
      total = static_cast<std::uint16_t>(total + here);
    }
  }
  each([&](std::uint16_t* of, std::uint32_t one) { out[of[one >> shift & 255]++] = static_cast<Out>(one); });
}

/// Each bucket's count becomes how many numbers lie in those before it. The array's length is a multiple of 16.
LAMINA_BODY void sum_up_before(std::uint16_t* bucket, std::uint32_t buckets) {
  SixteenCounts before = {};
  for (std::uint32_t i = 0; i < buckets; i += 16) {
    SixteenCounts own, sum;
    const SixteenCounts zero = {};
    std::memcpy(&own, bucket + i, sizeof own);
    sum = own + __builtin_shufflevector(zero, own, 0, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30);
    sum += __builtin_shufflevector(zero, sum, 0, 1, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29);
    sum += __builtin_shufflevector(zero, sum, 0, 1, 2, 3, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27);
    sum += __builtin_shufflevector(zero, sum, 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23);
    const SixteenCounts first = before + sum - own;
    std::memcpy(bucket + i, &first, sizeof first);
    before += __builtin_shufflevector(sum, sum, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15, 15);
  }
}

/// Sorts by the upper half of keys at once, stably: where there are few values, a bucket for each fits the nearest cache.
LAMINA_BODY void sort_at_once(const std::uint32_t* key, std::uint32_t count, std::uint32_t values, std::uint16_t* order) {
  alignas(64) std::uint16_t bucket[kFewValues];
  const std::uint32_t buckets = (values + 15) / 16 * 16;
  std::memset(bucket, 0, buckets * sizeof *bucket);
  for (std::uint32_t i = 0; i < count; ++i) ++bucket[key[i] >> 16];
  sum_up_before(bucket, buckets);
  for (std::uint32_t i = 0; i < count; ++i) order[bucket[key[i] >> 16]++] = static_cast<std::uint16_t>(i);
}

LAMINA_BODY void order_body(std::span<const Triangle> block, std::uint16_t* order) {
  Heights heights;
  see(block, heights);
  const BlockOrder position(heights, block.size());
  std::array<std::uint32_t, kBlockSize> key;  // the number of the triangle behind it
  const auto count = static_cast<std::uint32_t>(block.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    key[i] = static_cast<std::uint32_t>(position.key(heights.middle[i], heights.y[i])) << 16 | i;
  }
  // No key is greater than that of the greatest of both, for each grows with its own.
  const auto values = static_cast<std::uint32_t>(position.key(heights.highest, heights.back)) + 1;
  if (values <= kFewValues) return sort_at_once(key.data(), count, values, order);
  std::array<std::uint32_t, kBlockSize> half_sorted;
  sort_by_byte(key.data(), count, 16, half_sorted.data());
  sort_by_byte(half_sorted.data(), count, 24, order);
}

}  // namespace

void plain::order(std::span<const Triangle> block, std::uint16_t* order) { order_body(block, order); }
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 void avx2::order(std::span<const Triangle> block, std::uint16_t* order) { order_body(block, order); }
LAMINA_AVX512 void avx512::order(std::span<const Triangle> block, std::uint16_t* order) { order_body(block, order); }
#endif

}  // namespace lamina
