#include "stages/checks/tally.h"

#include <algorithm>
#include <cmath>

namespace lamina::checks {
namespace {

/// Rows of a group that are measured in one layer, each at another place of its stretch; more of them where layers are few.
constexpr std::uint32_t kRows = 8, kRowsInAll = 2000;

bool crosses(const Box& box, const Layer& layer) {
  return box.lo.z < layer.bottom + layer.thickness && layer.bottom < box.hi.z;
}

/// Set pixels of a row within [first, last).
std::uint64_t set_within(std::span<const std::uint32_t> row, std::uint32_t first, std::uint32_t last) {
  std::uint64_t set = 0;
  // An odd place is within a run, whose begin stands before it.
  auto at = static_cast<std::size_t>(std::upper_bound(row.begin(), row.end(), first) - row.begin()) & ~std::size_t{1};
  for (; at + 1 < row.size() && row[at] < last; at += 2) set += std::min(last, row[at + 1]) - std::max(first, row[at]);
  return set;
}

std::vector<Group> groups_of(std::span<const Solid> solids) {
  std::vector<Group> groups;
  std::vector<double> sum, largest;
  for (const Solid& solid : solids) {
    if (solid.group >= groups.size()) groups.resize(solid.group + 1);
    sum.resize(groups.size());
    largest.resize(groups.size());
    Group& group = groups[solid.group];
    if (group.box.empty()) group.part = solid.part;
    group.box.add(solid.box);
    group.closed = group.closed && solid.closed;
    sum[solid.group] += std::abs(solid.mesh_mm3);
    largest[solid.group] = std::max(largest[solid.group], std::abs(solid.mesh_mm3));
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    groups[g].max_mm3 = sum[g];
    groups[g].min_mm3 = largest[g];
  }
  return groups;
}

}  // namespace

Tally::Tally(std::vector<Solid> solids)
    : solids_(std::move(solids)),
      groups_(groups_of(solids_)),
      detected_(solids_.size()),
      planned_(groups_.size()),
      left_(groups_.size()) {}

Tally::ImageWindow Tally::window_of(const Box& box) const {
  const auto range = [](const PixelAxis& axis, Nm low, Nm high) {
    const auto clamp = [&](std::int64_t i) { return static_cast<std::uint32_t>(std::clamp<std::int64_t>(i, 0, axis.count)); };
    return std::array{clamp(axis.first_at_or_beyond(low)), clamp(axis.first_at_or_beyond(std::int64_t{high} + 1))};
  };
  const auto [left, right] = range(grid_->x, box.lo.x, box.hi.x);
  const auto [front, back] = range(grid_->y, box.lo.y, box.hi.y);
  return {left, right, grid_->rows() - back, grid_->rows() - front};
}

void Tally::inspect_layers(const PixelGrid& grid) {
  grid_ = &grid;
  for (const Solid& solid : solids_) solid_window_.push_back(window_of(solid.box));
  for (const Group& group : groups_) group_window_.push_back(window_of(group.box));
}

Tally::ImageWindow Tally::mirrored(ImageWindow window, const RunsView& image, bool mirror_x, bool mirror_y) {
  const auto turn = [](std::uint32_t& first, std::uint32_t& last, std::uint32_t count) {
    const std::uint32_t end = count - first;
    first = count - last;
    last = end;
  };
  if (mirror_x) turn(window.first_column, window.last_column, image.columns);
  if (mirror_y) turn(window.first_row, window.last_row, image.rows());
  return window;
}

void Tally::add_image(const Layer& layer, const RunsView& image, bool mirror_x, bool mirror_y) {
  for (std::uint32_t s = 0; s < solids_.size(); ++s) {
    if (detected(s) || !crosses(solids_[s].box, layer)) continue;
    const ImageWindow window = mirrored(solid_window_[s], image, mirror_x, mirror_y);
    for (std::uint32_t row = window.first_row; row < window.last_row; ++row) {
      if (set_within(image.row(row), window.first_column, window.last_column) == 0) continue;
      detected_[s].store(1, std::memory_order_relaxed);
      break;
    }
  }
  add(layer, image, mirror_x, mirror_y, planned_);
}

void Tally::add_left(const Layer& layer, const RunsView& image, bool mirror_x, bool mirror_y) {
  bleeds_.store(true, std::memory_order_relaxed);
  add(layer, image, mirror_x, mirror_y, left_);
}

void Tally::add(const Layer& layer, const RunsView& image, bool mirror_x, bool mirror_y, std::vector<Sum>& sums) const {
  const double pixel_mm2 = mm(1) * mm(1) / (grid_->x.pixels_per_nm() * grid_->y.pixels_per_nm());
  const auto measured = static_cast<std::uint32_t>(std::min<std::size_t>(groups_.size(), kMeasured));
  for (std::uint32_t g = 0; g < measured; ++g) {
    if (!crosses(groups_[g].box, layer)) continue;
    const ImageWindow window = mirrored(group_window_[g], image, mirror_x, mirror_y);
    const std::uint32_t rows = window.last_row - window.first_row;
    if (rows == 0 || window.first_column == window.last_column) continue;
    const auto layers =
        static_cast<std::uint32_t>(std::max(std::int64_t{1}, std::int64_t{groups_[g].box.height()} / layer.thickness));
    const std::uint32_t step = std::max(1u, rows / std::max(kRows, kRowsInAll / layers / measured));
    std::uint64_t set = 0;
    std::uint32_t inspected = 0;
    for (std::uint32_t first = 0; first < rows; first += step, ++inspected) {
      // Multiples of the golden section spread over a stretch of rows as layers and stretches go by: no period of a part
      // falls in with them.
      const std::uint32_t within = std::min(step, rows - first), position = (layer.index * 8191 + inspected) * 2654435769u;
      const std::uint32_t r = first + static_cast<std::uint32_t>(std::uint64_t{position} * within >> 32);
      // The same rows of the bed, whichever way the image is mirrored.
      const std::uint32_t row = mirror_y ? window.last_row - 1 - r : window.first_row + r;
      set += set_within(image.row(row), window.first_column, window.last_column);
    }
    const double pixels = static_cast<double>(set) * rows / static_cast<double>(inspected);
    sums[g].fetch_add(static_cast<std::uint64_t>(std::llround(pixels * pixel_mm2 * mm(layer.thickness) * 1e6)),
                      std::memory_order_relaxed);
  }
}

void Tally::add_area(std::uint32_t group, const Layer& layer, double area_mm2) {
  planned_[group].fetch_add(static_cast<std::uint64_t>(std::llround(std::max(0.0, area_mm2) * mm(layer.thickness) * 1e6)),
                            std::memory_order_relaxed);
}

}  // namespace lamina::checks
