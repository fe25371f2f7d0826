// stages/checks/mixed.h: layers that hold parts of more than one powder, known from heights alone.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/layer.h"

namespace lamina::checks {

/// Heights at which a part is of one powder: planes from <= z < to, nm, as sections have them.
struct PowderInterval {
  std::int64_t from = 0, to = 0;
  std::uint32_t material = 0;
};

/// Layers [first, last] that belong together.
using LayerRange = std::array<std::uint32_t, 2>;

/// The layers whose planes lie in stretches of more than one material, in order; neighbours are one range. Parts may be hollow
/// or lie under others there: such a layer can have pixels of one material alone.
/// planes  of the layers, increasing
/// cost    sorts the stretches, then one step a layer and a stretch; independent of meshes
std::vector<LayerRange> mixed_layers(std::vector<PowderInterval> intervals, std::uint32_t materials,
                                     std::span<const Nm> planes);

}  // namespace lamina::checks
