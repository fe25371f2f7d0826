// pipeline/plan/dose_zones.h: the parts of a job by what they get: their bleed, their saturation.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/dose/dilate.h"
#include "stages/dose/erode.h"
#include "stages/dose/holes.h"
#include "stages/dose/stretches.h"
#include "stages/dose/wish.h"

namespace lamina::pipeline {

/// A saturation of a job, and of its core.
dose::Wish wish_of(const Saturation& saturation, const std::optional<Saturation>& core);

/// How an edge moves.
struct EdgeMove {
  dose::Reach reach;
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

/// Scratch for moving edges; reused by later layers.
struct BleedWork {
  Runs moved, second, third, fourth;
  dose::HoleScratch holes;
  std::uint64_t bytes() const;
};

/// A layer's image with moved edges. What stands in a hole has the edges of that hole.
void move_edges(const RunsView& image, const Bleed& bleed, BleedWork& work, Runs& result);

/// Parts of one bleed and one saturation are a zone. Zone 0 is that of the job's own values.
class DoseZones {
 public:
  DoseZones(const Job& job, const PixelGrid& grid);

  std::uint32_t count() const { return static_cast<std::uint32_t>(zones_.size()); }
  bool several() const { return zones_.size() > 1; }
  std::uint32_t of_part(std::size_t part) const { return of_part_[part]; }
  std::span<const std::uint32_t> of_parts() const { return of_part_; }

  bool bleeds() const;
  bool grows() const;
  const Bleed& bleed(std::uint32_t zone, const Layer& layer) const {
    return layer.index < first_layers_ ? zones_[zone].first_bleed : zones_[zone].bleed;
  }
  /// How far a zone grows along x and y at most.
  std::array<std::int64_t, 2> grows_nm(std::uint32_t zone) const { return zones_[zone].grows_nm; }
  /// Pixels above and below that any edge moves to.
  std::uint32_t most_rows() const;

  /// The wishes of zones 1, 2, ...
  std::vector<std::optional<dose::Wish>> wishes() const;

  /// Moves the edges of a layer. Zones grow in their order, none into another.
  /// image  of all zones; `zone` has that of each where there are several, and no pixel is set in two
  void remove_bleed(const Layer& layer, Runs& image, std::span<Runs> zone, BleedWork& work) const;

 private:
  struct Zone {
    Bleed bleed, first_bleed;
    std::optional<dose::Wish> wish;
    std::array<std::int64_t, 2> grows_nm{};  // its outside
    bool operator==(const Zone&) const = default;
  };
  std::vector<Zone> zones_;
  std::vector<std::uint32_t> of_part_;
  std::uint32_t first_layers_ = 0;
};

/// What parts cover at most, after their edges moved.
std::vector<dose::ZoneBox> zone_boxes(const Scene& scene, const DoseZones& zones, const PixelGrid& grid);

}  // namespace lamina::pipeline
