#include "stages/checks/bodies.h"

#include <algorithm>

#include "stages/geometry/combine.h"

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

// Runs get the number of a run above that they touch, or a new one. Numbers of one piece are merged, and the least, that of the
// piece's first run, stands for it.
void Pieces::label(const RunsView& image, bool diagonal) {
  const std::size_t runs = image.change.size() / 2;
  of_run.resize(runs);
  first.clear();
  sets_.start(0);
  if (runs == 0) return;
  const std::uint32_t* const change = image.change.data();
  const std::uint32_t reach = diagonal ? 1 : 0;
  std::uint32_t above = 0, run = 0;
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    const std::uint32_t above_end = run, end = image.row_offset[r + 1] / 2;
    if (r > 0 && run < end && rows_aligned(image.row(r - 1), image.row(r), reach)) {
      while (run < end) of_run[run++] = of_run[above++];
      continue;
    }
    for (; run < end; ++run) {
      const std::uint32_t left = change[2 * run], right = change[2 * run + 1] + reach;
      while (above < above_end && change[2 * above + 1] + reach <= left) ++above;
      if (above == above_end || change[2 * above] >= right) {
        of_run[run] = sets_.add();
        first.push_back(run);
        continue;
      }
      const std::uint32_t number = of_run[run] = of_run[above];
      while (above + 1 < above_end && change[2 * above + 2] < right) {
        if (of_run[++above] != number) sets_.merge(number, of_run[above]);
      }
    }
    above = above_end;
  }
}

void Pieces::measure(const RunsView& image) {
  const std::uint32_t* const change = image.change.data();
  std::uint32_t pieces = 0;
  sets_.number([&](std::uint32_t piece, std::uint32_t number) {
    first[piece] = first[number];
    ++pieces;
  });
  first.resize(pieces);
  pixels.assign(pieces, 0);
  box.assign(pieces, PixelBox());
  for (std::uint32_t r = 0, run = 0; pieces > 0 && r < image.rows(); ++r) {
    for (const std::uint32_t end = image.row_offset[r + 1] / 2; run < end; ++run) {
      const std::uint32_t piece = of_run[run] = sets_.of(of_run[run]), left = change[2 * run], right = change[2 * run + 1];
      pixels[piece] += right - left;
      PixelBox& of = box[piece];
      of.left = std::min(of.left, left);
      of.right = std::max(of.right, right);
      of.top = std::min(of.top, r);
      of.bottom = r + 1;
    }
  }
}

std::uint64_t Follower::need(const RunsView& image) const {
  const std::uint64_t pieces = pieces_.count(), nodes = bodies_.size() + pieces, runs = image.change.size() / 2;
  const std::uint64_t of_pieces =
      runs * 2 * sizeof(std::uint32_t) + pieces * (sizeof(std::uint64_t) + sizeof(std::uint32_t) + sizeof(PixelBox));
  const std::uint64_t of_nodes =
      nodes * (2 * sizeof(std::uint32_t) + sizeof(Body)) + pieces * (sizeof(std::uint32_t) + sizeof(Body));
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
  hangs_.assign(pieces_.count(), Body::kNone);
}

}  // namespace lamina::checks
