// stages/dose/edges/bleed.h: binder that spreads beyond what is jetted: the edges of a layer move before it is.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/dose/edges/erode.h"
#include "stages/dose/edges/holes.h"

namespace lamina::dose {

/// Along x and y, in micrometres: above 0 edges move into what is set, below 0 out of it.
using BleedUm = std::array<double, 2>;

/// How an edge moves.
struct EdgeMove {
  Reach reach;
  bool grows = false;  // outwards from what is set; else into it
  bool any() const { return !reach.half_width.empty(); }
  bool operator==(const EdgeMove&) const = default;
};

/// Of the outside and of the holes of a layer.
struct Bleed {
  EdgeMove outside, holes;
  bool any() const { return outside.any() || holes.any(); }
  bool grows() const { return outside.grows || holes.grows; }
  bool operator==(const Bleed&) const = default;
};
Bleed bleed_of(const PixelGrid& grid, const BleedUm& outside, const BleedUm& holes);

/// Of the first layers of a job, and of those above.
struct ZoneBleed {
  Bleed first, above;
  bool operator==(const ZoneBleed&) const = default;
};

/// Scratch for moving edges; reused by later layers.
struct BleedWork {
  Runs moved, second, third, fourth;
  HoleScratch holes;
  std::uint64_t bytes() const;
};

/// The bleed of each zone of a job: parts that get the same dose.
class Bleeds {
 public:
  /// Layers that have the first bleed of their zone.
  explicit Bleeds(std::uint32_t first_layers = 0) : first_layers_(first_layers) {}
  void add_zone(ZoneBleed bleed) { zones_.push_back(std::move(bleed)); }

  bool any() const;
  bool grows() const;
  const Bleed& of(std::uint32_t zone, const Layer& layer) const {
    return layer.index < first_layers_ ? zones_[zone].first : zones_[zone].above;
  }
  /// Pixels above and below that any edge moves to.
  std::uint32_t max_rows() const;

  /// Moves the edges of a layer. Zones grow in their order, none into another.
  /// image  of all zones; `zone` has that of each where there are several, and no pixel is set in two
  void remove(const Layer& layer, Runs& image, std::span<Runs> zone, BleedWork& work) const;

 private:
  std::vector<ZoneBleed> zones_;
  std::uint32_t first_layers_;
};

}  // namespace lamina::dose
