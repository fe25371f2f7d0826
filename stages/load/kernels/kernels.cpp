#include "stages/load/kernels/kernels.h"

namespace lamina::load {

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
