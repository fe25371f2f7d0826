// stages/dose/edges.h: edges of a layer on runs: dilation, holes, and binder that spreads beyond what is jetted.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/dose/erode.h"

namespace lamina::dose {

/// All offsets (i columns, j rows) with (i px / x)^2 + (j py / y)^2 <= 1, decided in integers; px and py are the pitches in
/// whole picometres, x and y the half axes in whole nanometres. With an axis of 0 only offsets along the other one count.
/// x_nm, y_nm  0 .. 10^7, or equal and up to 10^9
Reach reach_of(const PixelGrid& grid, std::int64_t x_nm, std::int64_t y_nm);

/// A pixel is set if and only if a pixel within reach of it is: the complement of what erode() leaves of the complement,
/// with pixels beyond the image that are not set. What would grow beyond the image is cut off.
/// cost  O(rows of the reach x changes), nothing is expanded
void dilate(const RunsView& image, const Reach& reach, Runs& result);

/// Whether dilate() would cut anything off.
bool grows_beyond(const RunsView& image, const Reach& reach);

/// The image with its holes set: the pixels from which no way of steps along x and y over pixels that are not set leads out of
/// the image.
/// parent  scratch: of each gap between runs; 0 is the outside
/// cost    O(changes + rows), nearly
void fill_holes(const RunsView& image, Buffer<std::uint32_t>& parent, Runs& filled);

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
  Buffer<std::uint32_t> holes;
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
