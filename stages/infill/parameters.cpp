#include "stages/infill/parameters.h"

#include <numeric>

namespace lamina::infill {

MicroDegrees layer_angle(const FillParameters& parameters, std::uint32_t layer) {
  const std::int64_t blocks = layer / parameters.build_layers;
  const MicroDegrees step = ((parameters.angle_step % kTurn) + kTurn) % kTurn;
  const MicroDegrees base = ((parameters.angle_base % kTurn) + kTurn) % kTurn;
  return (base + blocks * step) % kTurn;
}

Nm layer_stagger(const FillParameters& parameters, std::uint32_t layer) {
  constexpr MicroDegrees kHalf = kTurn / 2;
  std::uint64_t turn = layer;
  if (!parameters.stagger_every_layer) {
    const MicroDegrees step = ((parameters.angle_step % kHalf) + kHalf) % kHalf;
    const auto period = static_cast<std::uint64_t>(step == 0 ? 1 : kHalf / std::gcd(step, kHalf));
    turn = layer / parameters.build_layers / period;
  }
  return parameters.stagger.empty() ? 0 : parameters.stagger[turn % parameters.stagger.size()];
}

}  // namespace lamina::infill
