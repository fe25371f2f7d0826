// stages/data/layer.h: one layer of the job, and the plane that stands for it.
#pragma once

#include <cstdint>

#include "stages/data/units.h"

namespace lamina {

/// Why a layer has its thickness.
enum class LayerReason : std::uint8_t { kUniform };

struct Layer {
  std::uint32_t index;  // from 0 at the bottom
  Nm bottom;            // nm above the bed
  Nm thickness;         // nm, > 0
  LayerReason reason = LayerReason::kUniform;

  /// Height at which the part is sampled: the middle of the layer, rounded down.
  Nm plane() const { return bottom + thickness / 2; }
};

}  // namespace lamina
