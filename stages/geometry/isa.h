// stages/geometry/isa.h: which instruction sets kernels may use on this processor.
#pragma once

#include <string_view>

#include "stages/data/choices.h"
#include "stages/data/status.h"

namespace lamina {

/// auto, plain, avx2, avx512
std::string_view isa_name(Isa isa);

/// The widest set that the processor and its operating system have; of x86-64's baseline, or of another processor, kPlain.
/// The environment variable LAMINA_ISA, a name as above, caps it. Read once.
///
/// kAvx2 means AVX2, BMI 1 and 2 and POPCNT; kAvx512 these and AVX-512 F, BW, DQ and VL.
Isa widest_isa();

/// `wanted`, or the widest where that is kAuto or more than the processor has.
Isa limited_isa(Isa wanted);

/// The set to use where `wanted` is requested; kAuto is the widest.
/// errors  kUsage if the processor does not have it, or LAMINA_ISA does not allow it
Result<Isa> usable_isa(Isa wanted);

/// The same for a processor and a value of LAMINA_ISA: nullptr and texts that are no name cap nothing.
Result<Isa> usable_isa(Isa wanted, Isa of_processor, const char* cap);

}  // namespace lamina
