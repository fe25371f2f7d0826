// stages/checks/bodies.h: bodies connected from layer to layer, followed upwards on runs.
//
// Pieces are connected within a layer; bodies are pieces that overlap in neighbouring layers. Of the layers below only the last
// one is kept, with the number of its body for each run.
//
// Source: disjoint-set union, R. E. Tarjan, "Efficiency of a Good But Not Linear Set Union Algorithm", Journal of the ACM
// 22(2), 1975; labels of runs row by row, A. Rosenfeld and J. L. Pfaltz, "Sequential Operations in Digital Picture Processing",
// Journal of the ACM 13(4), 1966.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"

namespace lamina::checks {

/// Columns and image rows, ends exclusive.
struct PixelBox {
  std::uint32_t left = UINT32_MAX, right = 0, top = UINT32_MAX, bottom = 0;
  void add(const PixelBox& other) {
    left = std::min(left, other.left);
    right = std::max(right, other.right);
    top = std::min(top, other.top);
    bottom = std::max(bottom, other.bottom);
  }
  PixelBox common(const PixelBox& other) const {
    return {std::max(left, other.left), std::min(right, other.right), std::max(top, other.top), std::min(bottom, other.bottom)};
  }
  bool meets(const PixelBox& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
};

/// The pixels of an image whose centres are in the box, in plan view, and `margin` more on each side, within the image.
PixelBox pixels_of(const Box& box, const PixelGrid& grid, std::int64_t margin);

inline std::uint64_t bytes_of(const Runs& runs) { return bytes_held(runs.row_offset) + bytes_held(runs.change); }

/// Rows [first, last), into buffers that keep their capacity; empty ones of an image without rows.
inline void copy_rows(const RunsView& from, std::uint32_t first, std::uint32_t last, Runs& to) {
  to.columns = from.columns;
  to.change.clear();
  to.row_offset.assign(std::size_t{last} - first + 1, 0);
  if (from.rows() < last) return;
  const auto offset = from.row_offset.begin();
  to.row_offset.assign(offset + first, offset + last + 1);
  for (std::uint32_t& at : to.row_offset) at -= from.row_offset[first];
  to.change.assign(from.change.begin() + from.row_offset[first], from.change.begin() + from.row_offset[last]);
}

/// Into buffers that keep their capacity.
inline void copy_runs(const RunsView& from, Runs& to) {
  to.columns = from.columns;
  to.row_offset.assign(from.row_offset.begin(), from.row_offset.end());
  to.change.assign(from.change.begin(), from.change.end());
}

/// Pieces that hang together.
struct Body {
  static constexpr std::uint32_t kNone = UINT32_MAX;
  std::uint64_t pixels = 0;                                // of all its layers
  std::uint64_t pixel_nm = 0;                              // pixels times thickness
  std::uint32_t first_layer = UINT32_MAX, last_layer = 0;  // numbers
  std::int64_t bottom = 0, top = 0;                        // nm above the bed
  PixelBox box;
  std::uint32_t owner = kNone;                     // any value of a follower's rules
  bool open = false;                               // the same
  std::uint32_t column = 0, row = 0;               // a pixel of its last layer
  std::uint64_t area = 0, tall = 0, detached = 0;  // pixels that rules count (ColumnBodies)
};

/// Sets of numbers; the least number of a set stands for it.
class Sets {
 public:
  void start(std::size_t count) {
    parent_.resize(count);
    std::iota(parent_.begin(), parent_.end(), 0u);
  }
  /// One more number, in a set of its own.
  std::uint32_t add() {
    parent_.push_back(static_cast<std::uint32_t>(parent_.size()));
    return parent_.back();
  }
  std::uint32_t find(std::uint32_t of) {
    while (parent_[of] != of) of = parent_[of] = parent_[parent_[of]];
    return of;
  }
  /// returns  the number that stands for both, and the one that no longer does; equal if they were one set
  std::pair<std::uint32_t, std::uint32_t> merge(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    if (b < a) std::swap(a, b);
    parent_[b] = a;
    return {a, b};
  }
  /// Numbers the sets from 0 by their least numbers; of() is the number of a set since, and sets do not change any more.
  /// each(number of a set, its least number)
  template <class Each>
  void number(const Each& each) {
    std::uint32_t sets = 0;
    for (std::uint32_t i = 0; i < parent_.size(); ++i) {
      if (parent_[i] == i) each(sets, i);
      parent_[i] = parent_[i] == i ? sets++ : parent_[parent_[i]];
    }
  }
  std::uint32_t of(std::uint32_t member) const { return parent_[member]; }
  std::uint64_t bytes() const { return bytes_held(parent_); }

 private:
  Buffer<std::uint32_t> parent_;  // no larger than the member
};

/// Calls visit(run of a, run of b) for runs of two rows that touch: share a column or, with `diagonal`, a corner.
template <class Visit>
void for_touching(const RunsView& a, std::uint32_t row_a, const RunsView& b, std::uint32_t row_b, bool diagonal,
                  const Visit& visit) {
  std::uint32_t i = a.row_offset[row_a] / 2, j = b.row_offset[row_b] / 2;
  const std::uint32_t i_end = a.row_offset[row_a + 1] / 2, j_end = b.row_offset[row_b + 1] / 2, reach = diagonal ? 1 : 0;
  if (i == i_end || j == j_end) return;
  while (i < i_end && j < j_end) {
    const std::uint32_t end_a = a.change[2 * i + 1], end_b = b.change[2 * j + 1];
    if (a.change[2 * i] < end_b + reach && b.change[2 * j] < end_a + reach) visit(i, j);
    (end_a < end_b ? i : j) += 1;
  }
}

/// The pieces of one layer. Keeps its buffers from layer to layer.
class Pieces {
 public:
  /// diagonal  whether pixels that share a corner alone touch
  void find(const RunsView& image, bool diagonal) {
    label(image, diagonal);
    measure(image);
  }
  std::size_t count() const { return box.size(); }
  // --- the same in two steps
  /// Sets of runs that touch; number_of() is one for each piece until measure().
  void label(const RunsView& image, bool diagonal);
  std::uint32_t number_of(std::uint32_t run) { return sets_.find(of_run[run]); }
  void measure(const RunsView& image);
  std::uint64_t bytes() const {
    return sets_.bytes() + bytes_held(of_run) + bytes_held(pixels) + bytes_held(first) + box.capacity() * sizeof(PixelBox);
  }

  Buffer<std::uint32_t> of_run;  // piece of each run
  Buffer<std::uint64_t> pixels;  // by piece
  std::vector<PixelBox> box;     // by piece
  Buffer<std::uint32_t> first;   // run of each piece

 private:
  Sets sets_;  // of numbers that runs get first
};

/// Follows bodies through layers that are given from the bottom up, one at a time.
class Follower {
 public:
  /// diagonal  within a layer; layers touch where they share a pixel
  explicit Follower(bool diagonal) : diagonal_(diagonal) {}

  /// The pieces of the next layer: before add() of it.
  void find(const RunsView& image) { pieces_.find(image, diagonal_); }
  const Pieces& pieces() const { return pieces_; }
  /// Bytes that are held once add() has been through the layer whose pieces were found.
  std::uint64_t need(const RunsView& image) const;

  /// Rules: begin(Body&) a piece with nothing below; grow(Body&) any piece, before it joins what is below; join(const Body&
  /// stays, const Body& ends, const Body& piece) two bodies of lower layers that a piece merges; fields `owner` and `open` of
  /// the merged body are those of the first that has one, and of either. end(const Body&) a body that does not continue.
  template <class Rules>
  void add(const Layer& layer, const RunsView& image, Rules& rules);

  /// After the last layer: calls end() of all bodies that it holds.
  template <class Rules>
  void finish(Rules& rules) {
    for (const Body& body : bodies_) rules.end(body);
    bodies_.clear();
  }

  /// The bodies of the last layer; rules may change owner and open of them between layers.
  std::span<Body> live() { return bodies_; }
  /// That of a pixel of the last layer; null if the pixel is not set.
  Body* body_at(std::uint32_t column, std::uint32_t row);

  /// The last layer.
  RunsView below() const { return below_; }
  /// Nothing continues: a layer without pieces changes nothing.
  bool is_idle() const { return bodies_.empty(); }

  std::uint64_t bytes() const {
    return pieces_.bytes() + sets_.bytes() + bytes_of(below_) + bytes_held(body_below_) + bytes_held(number_) +
           bytes_held(hangs_) + (bodies_.capacity() + next_.capacity()) * sizeof(Body);
  }

 private:
  void start(const Layer& layer, const RunsView& image);

  bool diagonal_;
  Pieces pieces_;
  Sets sets_;                         // bodies of the layer below, then pieces
  Runs below_;                        // the last layer
  Buffer<std::uint32_t> body_below_;  // of each of its runs
  std::vector<Body> bodies_;          // that the last layer holds, then one a piece
  std::vector<Body> next_;
  Buffer<std::uint32_t> number_;  // of each node in next_
  Buffer<std::uint32_t> hangs_;   // by piece: the body below that it was joined to last
};

template <class Rules>
void Follower::add(const Layer& layer, const RunsView& image, Rules& rules) {
  if (is_idle() && image.change.empty()) return;
  const auto old = static_cast<std::uint32_t>(bodies_.size());
  start(layer, image);
  for (std::size_t p = old; p < bodies_.size(); ++p) rules.grow(bodies_[p]);
  for (std::uint32_t r = 0; r < image.rows() && r < below_.view().rows(); ++r) {
    for_touching(below_, r, image, r, false, [&](std::uint32_t under, std::uint32_t over) {
      const std::uint32_t piece = pieces_.of_run[over];
      if (hangs_[piece] == body_below_[under]) return;
      hangs_[piece] = body_below_[under];
      const auto [stays, ends] = sets_.merge(body_below_[under], old + piece);
      if (stays == ends) return;
      if (ends < old) rules.join(bodies_[stays], bodies_[ends], bodies_[old + piece]);
      Body& all = bodies_[stays];
      const Body& other = bodies_[ends];
      all.pixels += other.pixels;
      all.pixel_nm += other.pixel_nm;
      if (other.first_layer < all.first_layer) all.bottom = other.bottom;
      all.first_layer = std::min(all.first_layer, other.first_layer);
      all.last_layer = std::max(all.last_layer, other.last_layer);
      all.top = std::max(all.top, other.top);
      all.box.add(other.box);
      all.area += other.area;
      all.tall += other.tall;
      all.detached += other.detached;
      all.open = all.open || other.open;
      if (all.owner == Body::kNone) all.owner = other.owner;
    });
  }
  for (std::uint32_t p = 0; p < pieces_.count(); ++p) {
    if (hangs_[p] == Body::kNone) rules.begin(bodies_[old + p]);
  }
  // Bodies that a piece of this layer belongs to continue, in the order of the pieces.
  number_.assign(bodies_.size(), Body::kNone);
  next_.clear();
  next_.reserve(pieces_.count());
  for (std::uint32_t p = 0; p < pieces_.count(); ++p) {
    const std::uint32_t root = sets_.find(old + p);
    if (number_[root] != Body::kNone) continue;
    number_[root] = static_cast<std::uint32_t>(next_.size());
    next_.push_back(bodies_[root]);
    next_.back().column = bodies_[old + p].column;
    next_.back().row = bodies_[old + p].row;
  }
  for (std::uint32_t b = 0; b < old; ++b) {
    if (sets_.find(b) == b && number_[b] == Body::kNone) rules.end(bodies_[b]);
  }
  body_below_.resize(pieces_.of_run.size());
  for (std::uint32_t p = 0; p < pieces_.count(); ++p) hangs_[p] = number_[sets_.find(old + p)];
  for (std::size_t i = 0; i < body_below_.size(); ++i) body_below_[i] = hangs_[pieces_.of_run[i]];
  std::swap(bodies_, next_);
  copy_runs(image, below_);
}

}  // namespace lamina::checks
