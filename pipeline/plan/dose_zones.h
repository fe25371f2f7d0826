// pipeline/plan/dose_zones.h: the parts of a job by what they get: their bleed, their saturation.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/grid.h"
#include "stages/dose/edges/bleed.h"
#include "stages/dose/stretches.h"
#include "stages/dose/wish.h"

namespace lamina::pipeline {

/// Parts of one bleed and one saturation are a zone. Zone 0 is that of the job's own values.
class DoseZones {
 public:
  DoseZones(const Job& job, const PixelGrid& grid);

  std::uint32_t count() const { return static_cast<std::uint32_t>(zones_.size()); }
  bool several() const { return zones_.size() > 1; }
  std::uint32_t of_part(std::size_t part) const { return of_part_[part]; }

  /// The moves of their edges.
  const dose::Bleeds& bleeds() const { return bleeds_; }
  /// How far a zone grows along x and y at most.
  std::array<std::int64_t, 2> grows_nm(std::uint32_t zone) const { return zones_[zone].grows_nm; }
  /// The wishes of zones 1, 2, ...
  std::vector<std::optional<dose::Wish>> wishes() const;

 private:
  struct Zone {
    dose::ZoneBleed bleed;
    std::optional<dose::Wish> wish;
    std::array<std::int64_t, 2> grows_nm{};  // its outside
    bool operator==(const Zone&) const = default;
  };
  std::vector<Zone> zones_;
  std::vector<std::uint32_t> of_part_;
  dose::Bleeds bleeds_;
};

/// What parts cover at most, after their edges moved.
std::vector<dose::ZoneBox> zone_boxes(const Scene& scene, const DoseZones& zones, const PixelGrid& grid);

}  // namespace lamina::pipeline
