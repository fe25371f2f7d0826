// stages/checks/tally.h: how much of each solid the layers hold, counted while they are made.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"

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
  void add_image(const Layer& layer, const RunsView& image, bool mirror_x = false, bool mirror_y = false);
  /// The same image after the bleed was removed.
  void add_left(const Layer& layer, const RunsView& image, bool mirror_x, bool mirror_y);

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
    const ImageWindow& window = solid_window_[solid];
    return window.first_column < window.last_column && window.first_row < window.last_row;
  }
  /// Groups beyond the first kMeasured are not measured in images.
  bool measured(std::uint32_t group) const { return !grid_ || group < kMeasured; }
  double planned_mm3(std::uint32_t group) const { return volume(planned_[group]); }
  double left_mm3(std::uint32_t group) const { return volume(left_[group]); }
  bool measures_bleed() const { return bleeds_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint32_t kMeasured = 4096;  // groups; the copies beyond them cost nothing
  struct ImageWindow {
    std::uint32_t first_column = 0, last_column = 0, first_row = 0, last_row = 0;  // [first, last), of the image
  };
  using Sum = std::atomic<std::uint64_t>;  // 1e-6 mm3
  static double volume(const Sum& sum) { return static_cast<double>(sum.load(std::memory_order_relaxed)) * 1e-6; }
  ImageWindow window_of(const Box& box) const;
  static ImageWindow mirrored(ImageWindow window, const RunsView& image, bool mirror_x, bool mirror_y);
  void add(const Layer& layer, const RunsView& image, bool mirror_x, bool mirror_y, std::vector<Sum>& sums) const;

  std::vector<Solid> solids_;
  std::vector<Group> groups_;
  const PixelGrid* grid_ = nullptr;
  std::vector<ImageWindow> solid_window_, group_window_;
  std::vector<std::atomic<std::uint8_t>> detected_;  // by solid
  std::vector<Sum> planned_, left_;                  // by group
  std::atomic<bool> bleeds_{false};
};

}  // namespace lamina::checks
