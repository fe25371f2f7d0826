// stages/geometry/angle.h: directions on the bed are whole millionths of a degree.
#pragma once

#include <cstdint>

namespace lamina {

/// An angle in millionths of a degree; 0 is +x, anticlockwise.
using MicroDegrees = std::int64_t;
inline constexpr MicroDegrees kTurn = 360'000'000;

}  // namespace lamina
