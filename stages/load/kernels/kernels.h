// stages/load/kernels/kernels.h: the inner loops that read a sound binary STL, a body for each instruction set; internal to
// load.
//
// All bodies of a loop give the same numbers, bit for bit: whole ones, and doubles that are rounded lane by lane as IEEE 754
// has it and summed in one order.
#pragma once

#include <cstddef>
#include <cstdint>

#include "stages/data/choices.h"
#include "stages/geometry/blocks/sorted_block.h"
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

}  // namespace lamina::load
