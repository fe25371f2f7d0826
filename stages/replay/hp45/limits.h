// stages/replay/hp45/limits.h: what is beyond the HP45 controller, its encoder or the machine about it.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "stages/replay/printing.h"

namespace lamina::replay::hp45 {

/// Bursts of PRM; none if the controller would fire others.
std::optional<std::uint32_t> primed(std::string_view number);

/// encoder_dpi  of the profile; 0: not stated
/// errors       kVerification: an encoder of so many counts an inch is not the machine's
Status check_encoder(double counts, double encoder_dpi, double step_um);

/// Whether the carriage gets to a place along the scan: the bed with ramps and room, where the head waits or is cared for, and
/// the spreader's ends if the gantry has it.
bool reaches(const Printing& printing, double counts_per_inch, double mm);

/// errors  kVerification: the firmware does not know a sweep's speed all the way
Status check_speed(double mm_s, double counts_per_inch);

}  // namespace lamina::replay::hp45
