// stages/load/kernels/kernels.h: the inner loops that read a sound binary STL, a body for each instruction set; internal to
// load.
//
// All bodies of a loop give the same numbers, bit for bit: whole ones, and doubles that are rounded lane by lane as IEEE 754
// has it and summed in one order.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "stages/data/choices.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/targets.h"
#include "stages/load/repair/census.h"
#include "stages/load/stl_binary.h"

namespace lamina::load {

struct LoadKernels {
  Isa isa;

  /// Snaps facets of binary STL in plain millimetres, and grows the box by them. false  one of them cannot be snapped
  bool (*snap)(const char* facets, std::size_t count, Triangle* out, CoordinateBox& box);
  /// Adds the facets of a block, and hashes its corners. share  of sampled_share()
  void (*census)(SortedBlock& block, std::uint64_t share, CensusSums& sums);
  /// Prisms of a block's facets over a plane.
  Prisms (*prisms)(const SortedBlock& block, Nm plane);
};

/// The bodies for an instruction set that this processor has (geometry/isa.h), not kAuto.
const LoadKernels& load_kernels_for(Isa isa);

namespace plain {
bool snap(const char* facets, std::size_t count, Triangle* out, CoordinateBox& box);
void census(SortedBlock& block, std::uint64_t share, CensusSums& sums);
Prisms prisms(const SortedBlock& block, Nm plane);
}  // namespace plain

#if defined(LAMINA_WIDE_KERNELS)
namespace avx2 {
LAMINA_AVX2 bool snap(const char* facets, std::size_t count, Triangle* out, CoordinateBox& box);
LAMINA_AVX2 void census(SortedBlock& block, std::uint64_t share, CensusSums& sums);
LAMINA_AVX2 Prisms prisms(const SortedBlock& block, Nm plane);
}  // namespace avx2

namespace avx512 {
LAMINA_AVX512 bool snap(const char* facets, std::size_t count, Triangle* out, CoordinateBox& box);
LAMINA_AVX512 void census(SortedBlock& block, std::uint64_t share, CensusSums& sums);
LAMINA_AVX512 Prisms prisms(const SortedBlock& block, Nm plane);
}  // namespace avx512
#endif

// --- how facets in plain millimetres are snapped, with any instruction set.
//
// A float times 1e6 = 2^6 * 15625 has at most 24 + 14 significant bits, so it is exact in double; adding a half to 38 bits is
// exact too unless the product is below 2^-15, where any rounding ends at 0 anyway. Truncation then gives llround(x * 1e6): to
// the nearest, halves away from zero. So nothing is rounded but once, and lanes are alike for any width.

inline constexpr std::size_t kStrip = 256;   // facets whose 2304 coordinates are snapped in one go
inline constexpr float kReach = 2147.4836f;  // the largest float below 2147.483647

inline constexpr std::size_t kStripNumbers = kStrip * 9;

/// Copies the coordinates of `size` facets. returns  how many there are now, a multiple of kStep
template <std::size_t kStep>
LAMINA_BODY std::size_t take_strip(const char* facets, std::size_t first, std::size_t size,
                                   std::array<float, kStripNumbers>& corner) {
  static_assert(kStep % 3 == 0 && kStripNumbers % kStep == 0);
  for (std::size_t i = 0; i < size; ++i) std::memcpy(corner.data() + 9 * i, facets + (first + i) * kFacetBytes + 12, 36);
  std::size_t numbers = 9 * size;
  // The last strip is filled up with corners that it has already, which change no bound.
  for (; numbers % kStep != 0; ++numbers) corner[numbers] = corner[numbers - 3];
  return numbers;
}

/// Adds lanes to a box: x, y, z, x and so on.
template <std::size_t kCount>
inline void put_lanes(const std::array<float, kCount>& lo, const std::array<float, kCount>& hi, CoordinateBox& box) {
  for (std::size_t i = 0; i < kCount; ++i) {
    box.lo[i % 3] = std::min(box.lo[i % 3], lo[i]);
    box.hi[i % 3] = std::max(box.hi[i % 3], hi[i]);
  }
}

}  // namespace lamina::load
