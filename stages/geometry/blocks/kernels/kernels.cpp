#include "stages/geometry/blocks/kernels/kernels.h"

namespace lamina {

const BlockKernels& block_kernels_for(Isa isa) {
  static constexpr BlockKernels kPlain{Isa::kPlain,   plain::match, plain::number, plain::write,
                                       plain::bounds, plain::index, plain::order};
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr BlockKernels kAvx2{Isa::kAvx2,   avx2::match, plain::number, plain::write,
                                      avx2::bounds, avx2::index, avx2::order};
  static constexpr BlockKernels kAvx512{Isa::kAvx512,   avx512::match, avx512::number, avx512::write,
                                        avx512::bounds, avx512::index, avx512::order};
  if (isa == Isa::kAvx512) return kAvx512;
  if (isa == Isa::kAvx2) return kAvx2;
#endif
  static_cast<void>(isa);
  return kPlain;
}

}  // namespace lamina
