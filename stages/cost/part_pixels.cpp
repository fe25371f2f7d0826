#include "stages/cost/part_pixels.h"

#include <algorithm>
#include <array>
#include <utility>

#include "stages/cost/cost.h"

namespace lamina::cost {
namespace {

/// The pixels of an axis whose centres lie on [low, high], [first, last).
std::array<std::uint32_t, 2> pixels_of(const PixelAxis& axis, std::int64_t low, std::int64_t high) {
  const auto at = [&](std::int64_t nm) {
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>(axis.first_at_or_beyond(nm), 0, axis.count));
  };
  return {at(low), at(high + 1)};
}

/// Edges, as in stages/coverage: voxel i lies from floor(i span / dots) to floor((i + 1) span / dots).
void reach_voxels(const PixelAxis& axis, std::int32_t& low, std::int32_t& high) {
  const std::int64_t first = floor_div((std::int64_t{low} + 1) * axis.dots + axis.span - 1, axis.span) - 1;
  const std::int64_t end = ceil_div(std::int64_t{high} * axis.dots, axis.span);
  low = static_cast<std::int32_t>(floor_div(first * axis.span, axis.dots));
  high = static_cast<std::int32_t>(floor_div(end * axis.span, axis.dots) - 1);
}

/// Of pixels [begin, end) of a run in a row.
constexpr auto as_one = [](std::size_t, std::uint32_t begin, std::uint32_t end) { return std::uint64_t{end - begin}; };

std::span<const std::uint32_t> changes_of(const LevelsView& image, std::uint32_t row) {
  const std::size_t first = image.row_offset[row];
  return image.change.subspan(2 * first, 2 * (image.row_offset[row + 1] - first));
}

}  // namespace

Box box_of_voxels(const Box& box, const PixelGrid& grid) {
  Box reached = box;
  if (box.lo.x >= box.hi.x || box.lo.y >= box.hi.y) return reached;
  reach_voxels(grid.x, reached.lo.x, reached.hi.x);
  reach_voxels(grid.y, reached.lo.y, reached.hi.y);
  return reached;
}

PartPixels::PartPixels(std::span<const Body> bodies, std::size_t parts, const PixelGrid& grid, bool mirror_x, bool mirror_y)
    : parts_(parts) {
  for (const Body& body : bodies) {
    if (body.box.lo.x > body.box.hi.x) continue;
    auto [left, right] = pixels_of(grid.x, body.box.lo.x, body.box.hi.x);
    auto [front, back] = pixels_of(grid.y, body.box.lo.y, body.box.hi.y);
    const std::uint32_t columns = grid.columns(), rows = grid.rows();
    if (mirror_x) left = columns - std::exchange(right, columns - left);
    if (!mirror_y) front = rows - std::exchange(back, rows - front);  // the image's first row is the last of the bed
    if (groups_.size() <= body.group) groups_.resize(body.group + 1);
    BodyGroup& group = groups_[body.group];
    const BodyWindow window{left, right, front, back, body.box.lo.z, body.box.hi.z, body.part};
    if (group.bodies.empty()) group.around = window;
    group.one_part = group.one_part && body.part == group.around.part;
    group.around.left = std::min(group.around.left, left);
    group.around.right = std::max(group.around.right, right);
    group.around.top = std::min(group.around.top, front);
    group.around.bottom = std::max(group.around.bottom, back);
    group.around.low = std::min(group.around.low, window.low);
    group.around.high = std::max(group.around.high, window.high);
    group.bodies.push_back(window);
  }
}

template <class Row>
std::uint64_t PartPixels::sum_in(const BodyWindow& window, std::uint32_t rows, const Row& row_of) {
  std::uint64_t sum = 0;
  for (std::uint32_t r = window.top; r < std::min(window.bottom, rows); ++r) {
    const auto [row, sum_of] = row_of(r);
    // Runs from the first one that ends behind the left side.
    std::size_t i = static_cast<std::size_t>(std::ranges::upper_bound(row, window.left) - row.begin()) / 2 * 2;
    for (; i + 1 < row.size() && row[i] < window.right; i += 2) {
      const std::uint32_t begin = std::max(row[i], window.left), end = std::min(row[i + 1], window.right);
      if (begin < end) sum += sum_of(i / 2, begin, end);
    }
  }
  return sum;
}

template <class Row>
std::vector<std::uint64_t> PartPixels::sums(const Layer& layer, std::uint32_t rows, const Row& row_of) const {
  std::vector<std::uint64_t> sums(parts_), weights;
  const auto reaches = [&](const BodyWindow& window) {
    return window.low <= layer.highest_plane() + kPlaneReach && window.high >= layer.lowest_plane();
  };
  for (const BodyGroup& group : groups_) {
    if (group.bodies.empty() || !reaches(group.around)) continue;
    const std::uint64_t together = sum_in(group.around, rows, row_of);
    if (group.one_part || together == 0) {
      sums[group.around.part] += together;
      continue;
    }
    weights.assign(group.bodies.size(), 0);
    for (std::size_t i = 0; i < group.bodies.size(); ++i)
      if (reaches(group.bodies[i])) weights[i] = sum_in(group.bodies[i], rows, row_of);
    const auto share = shares(static_cast<std::int64_t>(together), weights);
    for (std::size_t i = 0; i < group.bodies.size(); ++i) sums[group.bodies[i].part] += static_cast<std::uint64_t>(share[i]);
  }
  return sums;
}

std::vector<std::uint64_t> PartPixels::count(const Layer& layer, const RunsView& runs) const {
  return sums(layer, runs.rows(), [&](std::uint32_t r) { return std::pair(runs.row(r), as_one); });
}

std::vector<std::uint64_t> PartPixels::count(const Layer& layer, const LevelsView& image) const {
  return sums(layer, image.rows(), [&](std::uint32_t r) { return std::pair(changes_of(image, r), as_one); });
}

std::vector<std::uint64_t> PartPixels::sum(const Layer& layer, const LevelsView& image) const {
  return sums(layer, image.rows(), [&](std::uint32_t r) {
    const auto sum_of = [&image, first = image.row_offset[r]](std::size_t run, std::uint32_t begin, std::uint32_t end) {
      return std::uint64_t{end - begin} * image.level[first + run];
    };
    return std::pair(changes_of(image, r), sum_of);
  });
}

std::vector<std::uint64_t> PartPixels::drops(const Layer& layer, const DropImageView& image, const DropCounter& counter) const {
  const LevelsView& zones = image.zones;
  return sums(layer, zones.rows(), [&](std::uint32_t r) {
    const auto sum_of = [&, r, first = zones.row_offset[r]](std::size_t run, std::uint32_t begin, std::uint32_t end) {
      return counter.drops(zones.level[first + run], r, begin, end);
    };
    return std::pair(changes_of(zones, r), sum_of);
  });
}

std::vector<std::uint64_t> PartPixels::share(const Layer& layer, const LevelsView& image, std::uint8_t full,
                                             std::uint64_t voxels) const {
  std::vector<std::uint64_t> weights = sums(layer, image.rows(), [&](std::uint32_t r) {
    const auto sum_of = [&image, full, first = image.row_offset[r]](std::size_t run, std::uint32_t begin, std::uint32_t end) {
      const std::uint8_t level = image.level[first + run];
      return (level > full ? level - full : level) * std::uint64_t{end - begin};
    };
    return std::pair(changes_of(image, r), sum_of);
  });
  const auto whole = shares(static_cast<std::int64_t>(voxels), weights);
  std::ranges::copy(whole, weights.begin());
  return weights;
}

}  // namespace lamina::cost
