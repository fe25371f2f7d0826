#include "stages/geometry/isa.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

namespace lamina {
namespace {

constexpr std::string_view kNames[] = {"auto", "plain", "avx2", "avx512"};

Isa of_processor() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("bmi") != 0 &&
                    __builtin_cpu_supports("bmi2") != 0 && __builtin_cpu_supports("popcnt") != 0;
  const bool avx512 = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
                      __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512vl") != 0;
  return avx2 && avx512 ? Isa::kAvx512 : avx2 ? Isa::kAvx2 : Isa::kPlain;
#else
  return Isa::kPlain;
#endif
}

}  // namespace

std::string_view isa_name(Isa isa) { return kNames[static_cast<std::size_t>(isa)]; }

Isa capped_isa(Isa isa, const char* cap) {
  if (cap == nullptr) return isa;
  for (Isa named : {Isa::kPlain, Isa::kAvx2}) {
    if (isa_name(named) == cap) return std::min(isa, named);
  }
  return isa;
}

Isa widest_isa() {
  static const Isa isa = capped_isa(of_processor(), std::getenv("LAMINA_ISA"));
  return isa;
}

Result<Isa> usable_isa(Isa wanted) {
  const Isa widest = widest_isa();
  if (wanted == Isa::kAuto) return widest;
  if (wanted > widest) {
    return Error{Fault::kUsage, fmt::format("run.isa: {} is more than this processor has; use auto, or {} at most",
                                            isa_name(wanted), isa_name(widest))};
  }
  return wanted;
}

}  // namespace lamina
