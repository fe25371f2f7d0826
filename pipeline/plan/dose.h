// pipeline/plan/dose.h: the distribution of binder in a job's layers (stages/dose/).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/dose/budget.h"
#include "stages/dose/edges.h"
#include "stages/dose/layer_drops.h"
#include "stages/dose/saturation.h"

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
  /// The targets of zones 1, 2, ...
  std::vector<std::optional<dose::DoseTarget>> targets() const;

 private:
  struct Zone {
    dose::ZoneBleed bleed;
    std::optional<dose::DoseTarget> target;
    std::array<std::int64_t, 2> grows_nm{};  // its outside
    bool operator==(const Zone&) const = default;
  };
  std::vector<Zone> zones_;
  std::vector<std::uint32_t> of_part_;
  dose::Bleeds bleeds_;
};

/// What parts cover at most, after their edges moved.
std::vector<dose::ZoneBox> zone_boxes(const Scene& scene, const DoseZones& zones, const PixelGrid& grid);

/// What a machine's profile has that does nothing: care, joints.
void warn_of_machine(const Machine& machine, const HeadGrid& grid, std::vector<Warning>& warnings);

class DosePlan {
 public:
  DosePlan(const Job& job, const PixelGrid& grid);

  /// Decides the drops of all layers of a job.
  /// machine      null without one
  /// sweep_drops  of a pixel in one sweep
  /// range        [first, last) of the layers: what is made, and so warned of
  /// errors  kUsage: a saturation without a machine; less than the powder needs; shares of voxels that are thinned
  Status decide(const Job& job, const Machine* machine, std::uint32_t sweep_drops, const Scene& scene, std::uint32_t layers,
                const std::array<std::uint32_t, 2>& range, const std::function<Layer(std::uint32_t)>& layer,
                std::vector<Warning>& warnings);

  /// errors  kUsage: images of a format do not carry as many drops as were decided before
  Status check_images(std::string_view format) const;

  /// Whether the dose changes any layer.
  bool any() const { return bleeds() || thins() || saturates(); }
  /// Whether drops are not those of the image without bleed.
  bool changes_image() const { return thins() || saturates(); }
  /// In place of decide(), of a job on record.
  void restore(const Machine& machine, std::uint32_t sweep_drops, std::uint32_t max_drops);
  /// Whether a saturation or shares of voxels decide the drops, and how many a pixel can get; 0 if none does.
  bool saturates() const { return max_drops() > 0; }
  std::uint32_t max_drops() const { return rules_.max_drops; }
  /// Level of a full voxel; 0: the job requests no fill fractions of voxels.
  std::uint8_t full() const { return rules_.full; }
  /// The binder given and requested, for the summary; absent without a machine that states the size of its drops.
  const std::optional<dose::Budget>& budget() const { return budget_; }

  /// What parts get; the bleed of layers.
  const DoseZones& zones() const { return zones_; }
  bool bleeds() const { return zones_.bleeds().any(); }

  /// Whether the core of a layer is thinned.
  bool thins() const { return core_ < 1; }
  /// Gives an image without bleed its drops, of a job that thins cores. `second` is scratch.
  void thin(std::uint32_t layer, const Runs& image, Runs& second, dose::DropWork& work) const;

  /// The drops of a layer. `second` is scratch.
  /// deposited  work.deposited has the fill fractions of several solids
  /// materials  of the job, whose drops are distinguished if solids share voxels
  /// zone       the image of each zone, where there are several
  /// errors  kUsage: a formula has no number of per cent where a part lies, or one that does not bind
  Result<dose::ZoneSums> saturate(const Layer& layer, bool deposited, std::uint32_t materials, const Runs& image,
                                  std::span<const Runs> zone, Runs& second, dose::DropWork& work) const;

  /// Upper bound of the changes of edges that moved.
  std::uint64_t edges_bound(std::uint64_t changes) const {
    return zones_.bleeds().grows() ? changes * (2 * std::uint64_t{zones_.bleeds().max_rows()} + 1) : changes;
  }
  /// Of pixels or voxels of a layer those that blue noise may part from the one before them, at most; none of many jobs.
  bool parts_pixels() const {
    return thins() || (saturates() && (rules_.dithered ? targets_ || rules_.full > 0 : has_copies()));
  }
  std::uint64_t parted_pixels(const Runs& image, const dose::DropWork& work) const;
  /// What drops make of it. sizes  its edges moved
  dose::DropBound bound(const dose::DropSizes& sizes) const { return dose::bound_of(rules_, sizes); }
  /// Whether formulas may deposit the parts of a layer one by one.
  bool has_copies() const { return !copies_.empty(); }

 private:
  bool has_formula(const Layer& layer) const;
  void set_limits(const Machine& machine, std::uint32_t sweep_drops);
  Result<dose::ZoneSums> saturate_deposited(const Layer& layer, std::uint32_t materials, const Runs& image, Runs& second,
                                            dose::DropWork& work) const;

  DoseZones zones_;
  dose::DropRules rules_;
  double core_;
  PixelGrid grid_;
  std::optional<dose::DoseTargets> targets_;
  dose::Binder binder_;
  std::uint32_t limit_ = 0, full_drops_ = 1;  // full_drops: of a full pixel without a target
  double min_percent_ = 0;                    // that binds, of a job that has to; 0: it has not
  Mirror mirror_;
  std::vector<std::vector<dose::ZoneBox>> copies_;  // of each zone with formulas of its own
  std::optional<dose::Budget> budget_;
};

}  // namespace lamina::pipeline
