#include "stages/checks/bodies.h"

#include <algorithm>

namespace lamina::checks {

PixelBox pixels_of(const Box& box, const PixelGrid& grid, std::int64_t margin) {
  const auto range = [&](const PixelAxis& axis, Nm low, Nm high) {
    const auto clamp = [&](std::int64_t i) { return static_cast<std::uint32_t>(std::clamp<std::int64_t>(i, 0, axis.count)); };
    return std::pair(clamp(axis.first_at_or_beyond(low) - margin),
                     clamp(axis.first_at_or_beyond(std::int64_t{high} + 1) + margin));
  };
  const auto [left, right] = range(grid.x, box.lo.x, box.hi.x);
  const auto [front, back] = range(grid.y, box.lo.y, box.hi.y);
  return {left, right, grid.rows() - back, grid.rows() - front};
}

void Pieces::find(const RunsView& image, bool diagonal) {
  const std::size_t runs = image.change.size() / 2;
  sets_.start(runs);
  for (std::uint32_t r = 1; r < image.rows(); ++r) {
    for_touching(image, r - 1, image, r, diagonal, [&](std::uint32_t above, std::uint32_t run) { sets_.merge(above, run); });
  }
  of_run.resize(runs);
  pixels.clear();
  box.clear();
  first.clear();
  std::size_t roots = 0;
  for (std::uint32_t i = 0; i < runs; ++i) roots += sets_.find(i) == i ? 1 : 0;
  pixels.reserve(roots);
  box.reserve(roots);
  first.reserve(roots);
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    for (std::uint32_t i = image.row_offset[r] / 2; i < image.row_offset[r + 1] / 2; ++i) {
      const std::uint32_t root = sets_.find(i);
      if (root == i) {
        of_run[i] = static_cast<std::uint32_t>(box.size());
        box.emplace_back();
        pixels.push_back(0);
        first.push_back(i);
      }
      const std::uint32_t piece = of_run[i] = of_run[root];
      const std::uint32_t begin = image.change[2 * i], end = image.change[2 * i + 1];
      pixels[piece] += end - begin;
      box[piece].add({begin, end, r, r + 1});
    }
  }
}

std::uint64_t Follower::need(const RunsView& image) const {
  const std::uint64_t pieces = pieces_.count(), nodes = bodies_.size() + pieces, runs = image.change.size() / 2;
  const std::uint64_t of_pieces =
      runs * 2 * sizeof(std::uint32_t) + pieces * (sizeof(std::uint64_t) + sizeof(std::uint32_t) + sizeof(PixelBox));
  const std::uint64_t of_nodes = nodes * (2 * sizeof(std::uint32_t) + sizeof(Body)) + pieces * (1 + sizeof(Body));
  return of_pieces + of_nodes + runs * 3 * sizeof(std::uint32_t) + image.row_offset.size_bytes();
}

Body* Follower::body_at(std::uint32_t column, std::uint32_t row) {
  const RunsView below = below_;
  if (row >= below.rows()) return nullptr;
  const auto runs = below.row(row);
  const auto at = static_cast<std::uint32_t>(std::ranges::upper_bound(runs, column) - runs.begin());
  return at % 2 == 0 ? nullptr : &bodies_[body_below_[(below.row_offset[row] + at - 1) / 2]];
}

void Follower::start(const Layer& layer, const RunsView& image) {
  const std::size_t old = bodies_.size();
  bodies_.reserve(old + pieces_.count());
  for (std::size_t p = 0; p < pieces_.count(); ++p) {
    Body& body = bodies_.emplace_back();
    body.pixels = pieces_.pixels[p];
    body.pixel_nm = pieces_.pixels[p] * static_cast<std::uint64_t>(layer.thickness);
    body.first_layer = body.last_layer = layer.index;
    body.bottom = layer.bottom;
    body.top = std::int64_t{layer.bottom} + layer.thickness;
    body.box = pieces_.box[p];
    body.column = image.change[2 * pieces_.first[p]];
    body.row = body.box.top;
  }
  sets_.start(old + pieces_.count());
  hangs_.assign(pieces_.count(), 0);
}

}  // namespace lamina::checks
