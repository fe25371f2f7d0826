// stages/raster/layer_bound.h: how many segments and crossings a layer can have at most, before it is planned.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stages/data/grid.h"
#include "stages/raster/scan.h"

namespace lamina::raster {

/// A table over 1024 slabs of height. A facet counts in every slab that it reaches, with all rows of its box, so a
/// slab's entry bounds every plane in it.
class LayerBound {
 public:
  struct Count {
    std::uint64_t segments = 0, crossings = 0;
  };
  /// cost: one parallel pass over the facets of every mesh that stands at its own height
  LayerBound(std::span<const PlacedMesh> placed, const PixelGrid& grid);
  Count at(Nm plane) const;

 private:
  static constexpr std::uint32_t kSlabs = 1024;
  std::int64_t slab_height_ = 1;  // nm
  std::array<Count, kSlabs> slab_{};
};

}  // namespace lamina::raster
