// stages/load/kernels/kernels.cpp: volumes of prisms, 16 facets at a time, in one body that is compiled for each instruction
// set.
//
// Each lane is summed apart, cluster after cluster, and the lanes then in a fixed order, so every width rounds alike.
#include "stages/load/kernels/kernels.h"

namespace lamina::load {
namespace {

typedef Nm Eight __attribute__((vector_size(32)));
typedef double EightDouble __attribute__((vector_size(64)));

LAMINA_BODY void read_eight(const Nm* from, EightDouble& to) {
  Eight eight;
  std::memcpy(&eight, from, sizeof eight);
  to = __builtin_convertvector(eight, EightDouble);
}

// Unused lanes are points, which have no shadow.
LAMINA_BODY void prisms_body(const SortedBlock& block, Prisms& sum) {
  EightDouble shadows = {}, volumes = {};
  const double below = 3.0 * sum.plane;
  for (std::uint32_t c = 0; c < block.clusters(); ++c) {
    const Cluster& cluster = block.cluster[c];
    for (std::uint32_t lane = 0; lane < kClusterSize; lane += 8) {
      EightDouble x[3], y[3], z[3];
      for (std::uint32_t k = 0; k < 3; ++k) {
        read_eight(cluster.x[k] + lane, x[k]);
        read_eight(cluster.y[k] + lane, y[k]);
        read_eight(cluster.z[k] + lane, z[k]);
      }
      const EightDouble shadow = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
      shadows += shadow;
      volumes += shadow * (z[0] + z[1] + z[2] - below);
    }
  }
  for (std::uint32_t i = 0; i < 8; ++i) {
    sum.doubled_shadow += shadows[i];
    sum.sixfold_volume += volumes[i];
  }
}

}  // namespace

Prisms plain::prisms(const SortedBlock& block, Nm plane) {
  Prisms sum{0, 0, plane};
  prisms_body(block, sum);
  return sum;
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 Prisms avx2::prisms(const SortedBlock& block, Nm plane) {
  Prisms sum{0, 0, plane};
  prisms_body(block, sum);
  return sum;
}
LAMINA_AVX512 Prisms avx512::prisms(const SortedBlock& block, Nm plane) {
  Prisms sum{0, 0, plane};
  prisms_body(block, sum);
  return sum;
}
#endif

const LoadKernels& load_kernels_for(Isa isa) {
  static constexpr LoadKernels kPlain{Isa::kPlain, plain::snap, plain::census, plain::prisms};
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr LoadKernels kAvx2{Isa::kAvx2, avx2::snap, avx2::census, avx2::prisms};
  static constexpr LoadKernels kAvx512{Isa::kAvx512, avx512::snap, avx512::census, avx512::prisms};
  if (isa == Isa::kAvx512) return kAvx512;
  if (isa == Isa::kAvx2) return kAvx2;
#endif
  static_cast<void>(isa);
  return kPlain;
}

}  // namespace lamina::load
