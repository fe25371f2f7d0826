// stages/checks/solid_checks.h: what layers hold against what the meshes hold.
//
// codes   part-lost     a solid of which no layer has anything
//         volume        more or less planned than the meshes hold
//         bleed         the bleed takes away much of a part
//         layers-empty  empty layers amid a solid
//         tolerance     contours may move far
//         above-bed     a part that stands on nothing
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stages/checks/bodies.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"
#include "stages/geometry/bits.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// A mesh where it stands.
struct Solid {
  Box box;                  // nm, on the bed
  std::uint32_t part = 0;   // of the job
  std::uint32_t group = 0;  // solids whose boxes touch have one group: layers cannot distinguish them
  double mesh_mm3 = 0;      // of its triangles; hollows count negative, overlaps as often as they overlap
  bool closed = true;       // only then mesh_mm3 is a volume
};

/// Solids that layers cannot distinguish.
struct Group {
  Box box;
  std::uint32_t part = 0;           // of the first solid
  double min_mm3 = 0, max_mm3 = 0;  // bounds of the union of its solids, by their meshes
  bool closed = true;               // all of them
};

/// Of images, some rows of each group and layer are counted, others in each layer: a part of 100 layers is known within a
/// few percent for less than a hundredth of what the image costs.
///
/// Thread-safe; sums are whole numbers, so that they do not depend on the order of the layers.
class Tally {
 public:
  /// Of images, solids whose boxes overlap in plan view must share a group.
  explicit Tally(std::vector<Solid> solids);

  // --- images
  void inspect_layers(const PixelGrid& grid);
  /// The section of all solids. cost  some rows of each group, a few of a solid's until its first pixel is found
  void add_image(const Layer& layer, RowRuns image, bool mirror_x = false, bool mirror_y = false);
  /// The same image after the bleed was removed.
  void add_left(const Layer& layer, RowRuns image, bool mirror_x, bool mirror_y);

  // --- contours
  void add_area(std::uint32_t group, const Layer& layer, double area_mm2);

  std::span<const Solid> solids() const { return solids_; }
  std::span<const Group> groups() const { return groups_; }
  /// Whether any layer has a pixel in the solid's box, or an area in its group.
  bool detected(std::uint32_t solid) const {
    return grid_ ? detected_[solid].load(std::memory_order_relaxed) != 0 : planned_mm3(solids_[solid].group) > 0;
  }
  /// Whether a pixel's centre is in the solid's box, in plan view; of images.
  bool has_pixels(std::uint32_t solid) const {
    const PixelBox& window = solid_window_[solid];
    return window.left < window.right && window.top < window.bottom;
  }
  /// Groups beyond the first kMeasured are not measured in images.
  bool measured(std::uint32_t group) const { return !grid_ || group < kMeasured; }
  double planned_mm3(std::uint32_t group) const { return volume(planned_[group]); }
  double left_mm3(std::uint32_t group) const { return volume(left_[group]); }
  bool measures_bleed() const { return bleeds_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint32_t kMeasured = 4096;  // groups; the copies beyond them cost nothing
  using Sum = std::atomic<std::uint64_t>;           // 1e-6 mm3
  static void add_to(Sum& sum, double mm3) {
    sum.fetch_add(static_cast<std::uint64_t>(std::llround(mm3 * 1e6)), std::memory_order_relaxed);
  }
  static double volume(const Sum& sum) { return static_cast<double>(sum.load(std::memory_order_relaxed)) * 1e-6; }
  static PixelBox mirrored(PixelBox window, const RowRuns& image, bool mirror_x, bool mirror_y);
  void add(const Layer& layer, RowRuns& image, bool mirror_x, bool mirror_y, std::vector<Sum>& sums) const;

  std::vector<Solid> solids_;
  std::vector<Group> groups_;
  const PixelGrid* grid_ = nullptr;
  std::vector<PixelBox> solid_window_, group_window_;
  std::vector<std::atomic<std::uint8_t>> detected_;  // by solid
  std::vector<Sum> planned_, left_;                  // by group
  std::atomic<bool> bleeds_{false};
};

/// How the job sees its solids.
struct Sampling {
  std::array<double, 2> pixel_mm{};  // 0 without pixels
  double thickest_mm = 0;            // of all layers
  std::array<double, 2> bleed_um{};  // along x and y; 0 where parts or edges have several
  double tolerance_um = 0;           // of contours
  double offset_mm = 0;              // of contours
  /// What was tallied are images of a finished job: without their bleed, and with the drops that they got.
  bool finished = false;
  bool bleeds = false;                // of a finished job
  bool drops_none = false;            // of a finished job: some part gets no drop, which is reported already
  bool one_sided = false;             // steps lie inside or outside of the parts, on purpose
  std::span<const std::string> part;  // names of files
  /// The volume of the union of a group's solids, mm3, also where shells overlap or are inside out; 0: the volumes of the
  /// meshes count. Requested only of groups with an uncertain volume by those; where it fails, no volume is reported.
  std::function<Result<double>(std::uint32_t group)> union_mm3 = {};
};

/// One warning for each part and kind at most; the worst of its copies is named.
/// errors  kInterrupted and kMemory of sampling.union_mm3
Status check_solids(const Tally& tally, const Sampling& sampling, std::vector<Warning>& warnings);

/// filled  by layer: whether it has anything; of the whole job
void check_layers(std::span<const Solid> solids, std::span<const std::uint8_t> filled,
                  const std::function<Layer(std::uint32_t)>& layer, std::vector<Warning>& warnings);

/// Contours may move by a fiftieth of a part's narrower side, at least 0.05 and at most 0.25 mm.
void check_tolerance(std::span<const Solid> solids, const Sampling& sampling, std::vector<Warning>& warnings);

/// Parts that are neither on the bed nor on the box of another solid; for printers that extrude beads.
void check_footing(std::span<const Solid> solids, const Sampling& sampling, std::vector<Warning>& warnings);

/// errors  kInput: why nothing at all is planned, and what to do; none if the solids do not explain it
Status check_anything(const Tally& tally, const Sampling& sampling);

// --- planes that meet a facet; layers at them are not rightly empty.

/// For each of some rising planes, whether a facet crosses it. cost  O(T log P) for each instance of another mesh or height
std::vector<std::uint8_t> crossed_planes(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                         std::span<const Nm> planes);

// --- what the solids of a group hold together, computed once for groups that are copies of each other.

/// Not thread-safe.
class GroupUnion {
 public:
  /// What instances hold together, mm3; 0 if that is not known.
  using Volume = std::function<Result<double>(std::span<const Mesh>, std::span<const Instance>)>;
  /// Reads the meshes again.
  using Again = std::function<Result<std::vector<Mesh>>()>;

  /// meshes  of the job; only their fingerprints are read if `again` is given. Must outlive this object
  /// solids  one for each instance; both must outlive this object
  /// again   where the triangles of the meshes are gone: called once, for the first volume
  GroupUnion(std::span<const Mesh> meshes, std::span<const Instance> instances, std::span<const Solid> solids, Volume volume,
             Again again = {});

  /// errors  of `again` and `volume`; kInput: a mesh of the group has changed since
  /// cost    `volume` once for all groups that hold the same meshes in the same places relative to each other
  Result<double> mm3(std::uint32_t group);

 private:
  using Key = std::vector<std::array<std::int64_t, 4>>;  // mesh, and x, y, z from the first
  static Key key_of(std::span<const Instance> members);
  Result<double> compute(std::span<const Instance> members);

  std::span<const Mesh> meshes_;
  Volume volume_;
  Again again_;
  std::vector<std::vector<Instance>> members_;  // by group
  std::optional<Result<std::vector<Mesh>>> reread_;
  std::map<Key, Result<double>> known_;
};

}  // namespace lamina::checks
