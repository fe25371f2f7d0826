// stages/heights/uniform.h: a layer table of one thickness.
#pragma once

#include <cstdint>

#include "stages/data/layer.h"
#include "stages/data/status.h"

namespace lamina::heights {

/// Layers of equal thickness, from 0 up; made on demand, none is stored.
class UniformTable {
 public:
  /// height, thickness  nm, > 0
  /// The last layer counts even where it is only partly filled: ceil(height / thickness) layers.
  UniformTable(std::int64_t height, Nm thickness)
      : thickness_(thickness), count_(static_cast<std::uint32_t>(ceil_div<std::int64_t>(height, thickness))) {}

  std::uint32_t size() const { return count_; }
  Layer operator[](std::uint32_t index) const {
    return {index, static_cast<Nm>(std::int64_t{index} * thickness_), thickness_, LayerReason::kUniform};
  }

 private:
  Nm thickness_;
  std::uint32_t count_;
};

}  // namespace lamina::heights
