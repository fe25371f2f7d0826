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

}  // namespace

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
    Group& group = groups_[body.group];
    const Window window{left, right, front, back, body.box.lo.z, body.box.hi.z, body.part};
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

std::uint64_t PartPixels::pixels_in(const Window& window, const RunsView& runs) {
  std::uint64_t pixels = 0;
  for (std::uint32_t r = window.top; r < std::min(window.bottom, runs.rows()); ++r) {
    const auto row = runs.row(r);
    // Runs from the first one that ends behind the left side.
    std::size_t i = static_cast<std::size_t>(std::ranges::upper_bound(row, window.left) - row.begin()) / 2 * 2;
    for (; i + 1 < row.size() && row[i] < window.right; i += 2) {
      const std::uint32_t begin = std::max(row[i], window.left), end = std::min(row[i + 1], window.right);
      if (begin < end) pixels += end - begin;
    }
  }
  return pixels;
}

std::vector<std::uint64_t> PartPixels::count(const Layer& layer, const RunsView& runs) const {
  std::vector<std::uint64_t> pixels(parts_), weights;
  const auto reaches = [&](const Window& window) {
    return window.low <= layer.highest_plane() && window.high >= layer.lowest_plane();
  };
  for (const Group& group : groups_) {
    if (group.bodies.empty() || !reaches(group.around)) continue;
    const std::uint64_t together = pixels_in(group.around, runs);
    if (group.one_part || together == 0) {
      pixels[group.around.part] += together;
      continue;
    }
    weights.assign(group.bodies.size(), 0);
    for (std::size_t i = 0; i < group.bodies.size(); ++i) {
      if (reaches(group.bodies[i])) weights[i] = pixels_in(group.bodies[i], runs);
    }
    const auto share = shares(static_cast<std::int64_t>(together), weights);
    for (std::size_t i = 0; i < group.bodies.size(); ++i) pixels[group.bodies[i].part] += static_cast<std::uint64_t>(share[i]);
  }
  return pixels;
}

}  // namespace lamina::cost
