#include "pipeline/calibrate/bead_voxels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/pores/period.h"
#include "stages/raster/beads.h"

namespace lamina::pipeline {
namespace {

/// The width of a bead at a height above the middle of its layer, nm; 0 where it is not.
Nm width_at(Nm width, std::int64_t height, double above) {
  const double round = static_cast<double>(std::min<std::int64_t>(width, height)), half = round / 2;
  if (std::abs(above) >= half) return 0;
  return static_cast<Nm>(std::lround(static_cast<double>(width) - round + 2 * std::sqrt(half * half - above * above)));
}

/// Beads that may reach into the window.
void keep_near(const Box& box, Buffer<LaidBead>& beads) {
  std::erase_if(beads, [&](const LaidBead& bead) {
    const std::int64_t reach = bead.width;
    return std::max(bead.from.x, bead.to.x) + reach < box.lo.x || std::min(bead.from.x, bead.to.x) - reach > box.hi.x ||
           std::max(bead.from.y, bead.to.y) + reach < box.lo.y || std::min(bead.from.y, bead.to.y) - reach > box.hi.y;
  });
}

/// Beads of one layer become slices.
class SliceCutter {
 public:
  SliceCutter(const Window& window)
      : origin_{window.box.lo.x, window.box.lo.y},
        raster_({PixelAxis(window.count[0], window.box.width(), window.box.width()),
                 PixelAxis(window.count[1], window.box.depth(), window.box.depth())}) {}

  /// above  nm, of the slice, over the middle of the layer
  const Runs& cut(std::span<const LaidBead> beads, std::int64_t height, double above) {
    raster_.clear();
    for (const LaidBead& bead : beads) {
      const Nm width = width_at(bead.width, height, above);
      const auto at = [&](Point2 p) { return Point2{p.x - origin_.x, p.y - origin_.y}; };
      if (width > 0) raster_.add(at(bead.from), at(bead.to), width, raster::BeadEnds::kRound);
    }
    raster_.runs(image_);
    // Images begin at the back of the bed, windows in front.
    upright_.columns = image_.columns;
    upright_.row_offset.assign(1, 0);
    upright_.change.clear();
    for (std::uint32_t r = image_.view().rows(); r-- > 0;) {
      const auto row = image_.view().row(r);
      upright_.change.insert(upright_.change.end(), row.begin(), row.end());
      upright_.row_offset.push_back(static_cast<std::uint32_t>(upright_.change.size()));
    }
    return upright_;
  }

 private:
  Point2 origin_;
  raster::BeadRaster raster_;
  Runs image_, upright_;
};

}  // namespace

Result<Pile> pile_of(const read::GcodeFile& file) {
  Pile pile;
  std::int64_t top = 0;
  for (std::uint32_t i = 0; i < file.count(); ++i) {
    const Result<read::GcodeLayer> layer = file.layer(i);
    if (!layer) return layer.error();
    if (layer->beads.empty()) continue;
    if (layer->z <= top) {
      ++pile.skipped;
      continue;
    }
    pile.layers.push_back({i, top, layer->z});
    top = layer->z;
  }
  return pile;
}

Result<VoxelStack> bead_voxels(const read::GcodeFile& file, const Pile& pile, const Window& window) {
  const Box& box = window.box;
  const std::array<std::int64_t, 3> side = {box.width(), box.depth(), box.height()};
  std::array<Nm, 3> edge{};
  for (std::size_t a = 0; a < 3; ++a) edge[a] = static_cast<Nm>((side[a] + window.count[a] / 2) / window.count[a]);
  VoxelStack stack(window.count[0], window.count[1], edge, window.periodic);
  SliceCutter cutter(window);
  auto layer = pile.layers.begin();
  Result<read::GcodeLayer> beads = read::GcodeLayer{};
  std::int64_t read_low = -1;
  for (std::uint32_t k = 0; k < window.count[2]; ++k) {
    const std::int64_t z = box.lo.z + (2 * std::int64_t{k} + 1) * side[2] / (2 * std::int64_t{window.count[2]});
    while (layer != pile.layers.end() && layer->high <= z) ++layer;
    if (layer != pile.layers.end() && layer->low <= z && layer->low != read_low) {
      beads = file.layer(layer->index);
      if (!beads) return beads.error();
      read_low = layer->low;
      keep_near(box, beads->beads);
    }
    const bool within = layer != pile.layers.end() && layer->low <= z;
    const std::int64_t height = within ? layer->high - layer->low : 1;
    const double above = within ? static_cast<double>(z) - static_cast<double>(layer->low + layer->high) / 2 : 1;
    if (!stack.append(
            cutter.cut(within ? std::span<const LaidBead>(beads->beads) : std::span<const LaidBead>(), height, above)))
      return Error{Fault::kInput, "the window has too many runs of voxels; take a smaller one or larger voxels"};
  }
  return stack;
}

Result<Repeat> find_repeat(const read::GcodeFile& file, const Pile& pile, Point2 middle, std::size_t layer) {
  constexpr Nm kVoxel = 10'000, kLeast = 150'000, kHalf = 4'500'000;  // nm
  constexpr std::uint32_t kMostLayers = 8;
  constexpr double kMiss = 0.02;
  const auto around = [&](const Pile::Layer& of) {
    Window window;
    const auto half = static_cast<Nm>((of.high - of.low) / 2);
    const auto low = static_cast<Nm>(of.low + half - 1);
    window.box.add(Point3{middle.x - kHalf, middle.y - kHalf, low});
    window.box.add(Point3{middle.x + kHalf, middle.y + kHalf, low + 2});
    window.count = {2 * kHalf / kVoxel, 2 * kHalf / kVoxel, 1};
    return bead_voxels(file, pile, window);
  };
  const auto image_of = [](const VoxelStack& slice) { return RunsView{slice.nx, slice.row_offset, slice.change}; };
  const Result<VoxelStack> slice = around(pile.layers[layer]);
  if (!slice) return slice.error();
  Repeat repeat;
  std::array<bool, 2> none{};
  // Each layer has its own period, or is the same all along: the longest one holds for all if the others go into it.
  for (std::uint32_t n = 0; n <= kMostLayers && layer + n < pile.layers.size(); ++n) {
    const Result<VoxelStack> above = around(pile.layers[layer + n]);
    if (!above) return above.error();
    if (n > 0 && pores::mismatch(image_of(*slice), image_of(*above)) <= kMiss) {
      repeat.layers = n;
      break;
    }
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const std::int64_t here = std::int64_t{kVoxel} * pores::period(image_of(*above), axis == 0, kLeast / kVoxel, kMiss);
      const std::int64_t longer = std::max(here, repeat.length[axis]), shorter = std::min(here, repeat.length[axis]);
      const std::int64_t rest = shorter > kLeast ? longer % shorter : 0;
      none[axis] = none[axis] || here == 0 || std::min(rest, shorter - rest) > kVoxel;
      repeat.length[axis] = longer;
    }
  }
  for (std::size_t axis = 0; axis < 2; ++axis)
    if (none[axis]) repeat.length[axis] = 0;
  return repeat;
}

}  // namespace lamina::pipeline
