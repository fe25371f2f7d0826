#include "stages/coverage/band/kernels.h"

#include "stages/geometry/targets.h"

namespace lamina::coverage {

namespace plain {
BandKernels::Deposit deposit;
BandKernels::Sweep sweep;
BandKernels::Split split;
}  // namespace plain
namespace avx2 {
BandKernels::Deposit deposit;
BandKernels::Sweep sweep;
BandKernels::Split split;
}  // namespace avx2
namespace avx512 {
BandKernels::Deposit deposit;
BandKernels::Sweep sweep;
BandKernels::Split split;
}  // namespace avx512

const BandKernels& band_kernels_for([[maybe_unused]] Isa isa) {
  static constexpr BandKernels kPlain{plain::deposit, plain::sweep, plain::split};
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr BandKernels kAvx2{avx2::deposit, avx2::sweep, avx2::split},
      kAvx512{avx512::deposit, avx512::sweep, avx512::split};
  if (isa == Isa::kAvx512) return kAvx512;
  if (isa == Isa::kAvx2) return kAvx2;
#endif
  return kPlain;
}

}  // namespace lamina::coverage
