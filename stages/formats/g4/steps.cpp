#include "stages/formats/g4/steps.h"

#include "stages/geometry/targets.h"

namespace lamina::formats::g4 {

const StepsBody* steps_body([[maybe_unused]] Isa isa) {
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr StepsBody kAvx2{8, avx2::put_steps}, kAvx512{16, avx512::put_steps};
  if (isa == Isa::kAvx512) return &kAvx512;
  if (isa == Isa::kAvx2) return &kAvx2;
#endif
  return nullptr;
}

}  // namespace lamina::formats::g4
