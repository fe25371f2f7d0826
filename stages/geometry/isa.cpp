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

/// The variable's value at the first call.
const char* cap() {
  static const char* const value = std::getenv("LAMINA_ISA");
  return value;
}

/// `isa`, or what a name caps it to.
Isa capped_isa(Isa isa, const char* cap) {
  if (cap == nullptr) return isa;
  for (Isa named : {Isa::kPlain, Isa::kAvx2}) {
    if (kNames[static_cast<std::size_t>(named)] == cap) return std::min(isa, named);
  }
  return isa;
}

}  // namespace

std::string_view isa_name(Isa isa) { return kNames[static_cast<std::size_t>(isa)]; }

Isa widest_isa() {
  static const Isa isa = capped_isa(of_processor(), cap());
  return isa;
}

Isa limited_isa(Isa wanted) { return wanted == Isa::kAuto ? widest_isa() : std::min(wanted, widest_isa()); }

Result<Isa> usable_isa(Isa wanted, Isa of_processor, const char* cap) {
  const Isa widest = capped_isa(of_processor, cap);
  if (wanted == Isa::kAuto) return widest;
  if (wanted > of_processor) {
    return Error{Fault::kUsage, fmt::format("run.isa: {} is more than this processor has; use auto, or {} at most",
                                            isa_name(wanted), isa_name(widest))};
  }
  if (wanted > widest) {
    return Error{Fault::kUsage, fmt::format("run.isa: {} is more than the environment variable LAMINA_ISA={} allows; unset "
                                            "it, or use auto, or {} at most",
                                            isa_name(wanted), cap, isa_name(widest))};
  }
  return wanted;
}

Result<Isa> usable_isa(Isa wanted) {
  static const Isa processor = of_processor();
  return usable_isa(wanted, processor, cap());
}

}  // namespace lamina
