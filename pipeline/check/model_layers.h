// pipeline/check/model_layers.h: compares the layers of a G-code file with sections of the model that it was made from.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct ModelComparison {
  std::string reason;  // why nothing was compared; empty: compared
  std::uint32_t layers = 0;
  std::array<double, 2> moved_mm{};  // from the model's file to the beads
  double model_mm3 = 0, bead_mm3 = 0;
  /// Bead volume over area x thickness, by layer; and the share of the outline that is within kNearMm of an outer wall.
  struct LayerShare {
    double value = 0;
    std::uint32_t layer = 0;
  };
  LayerShare min_fill, max_fill, min_outline;
  double mean_fill() const { return model_mm3 > 0 ? bead_mm3 / model_mm3 : 0; }
};
inline constexpr double kNearMm = 0.9;

/// Slices the model at the middles of the file's layers and moves it in x and y to the box of the outer walls. Supports and
/// skirts by their types are left out. A layer of which less of the outline has an outer wall than of its neighbours is a
/// fault.
///
/// filament_mm  diameter; 0: the file's
/// errors       kUsage, kInput: the model or the file cannot be read
/// cost         that of a slice; beads of a layer at a time
Result<ModelComparison> compare_with_model(const std::string& path, const std::string& model, double filament_mm,
                                           Faults& faults);

}  // namespace lamina::pipeline
