// stages/checks/columns.h: vertical columns of pixels, followed upwards on runs: where they begin, how tall they are, how they
// end. They measure along z what stencils (thin.h) measure within a layer.
#pragma once

#include <cstdint>
#include <span>

#include "stages/checks/bodies.h"
#include "stages/data/buffer.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"

namespace lamina::checks {

/// Neighbouring columns of a row that begin in the same layer.
struct ColumnSpan {
  std::uint32_t begin = 0, end = 0;
  Nm bottom = 0;                  // nm above the bed; kEndless: below the first layer
  std::uint32_t first_layer = 0;  // number
  std::uint32_t attached = 0;     // 1: something wide enough is below the first layer, or above the last one
  std::uint32_t row = 0;          // of ended ones
  static constexpr Nm kEndless = -kNmReach;
};

class Columns {
 public:
  /// Takes the next layer. base  what columns that begin in it are attached to: an image of the layer below, or empty.
  /// cost  O(runs + spans)
  void add(const Layer& layer, const RunsView& image, const RunsView& base);
  /// Ends all columns.
  void finish();
  /// Columns that ended below the last layer that was added, from the top row down, from the left.
  std::span<const ColumnSpan> ended() const { return ended_; }
  /// Nothing continues.
  bool is_idle() const { return span_.empty(); }

  /// Bytes that it holds after add(), and what ends then. of_ended  bytes that the caller keeps of each span that ends
  std::uint64_t need(const RunsView& image, const RunsView& base, std::uint64_t of_ended) const {
    return (2 * bound(image, base) + span_.size()) * sizeof(ColumnSpan) + span_.size() * of_ended;
  }
  std::uint64_t bytes() const {
    return bytes_held(row_) + bytes_held(next_row_) + bytes_held(span_) + bytes_held(next_) + bytes_held(ended_);
  }

 private:
  std::uint64_t bound(const RunsView& image, const RunsView& base) const {
    return 2 * span_.size() + image.change.size() / 2 + base.change.size();
  }
  void push(ColumnSpan span);
  void begin_columns(std::uint32_t begin, std::uint32_t end, std::span<const std::uint32_t> base, const ColumnSpan& kind);
  void end_columns(std::uint32_t row, std::size_t& at, std::size_t last, std::uint32_t from, std::uint32_t to);

  Buffer<std::uint32_t> row_, next_row_;  // offsets of rows
  Buffer<ColumnSpan> span_, next_, ended_;
};

/// Splits spans where they are within the image; those within are attached.
void attach(std::span<const ColumnSpan> spans, const RunsView& image, Buffer<ColumnSpan>& result);
/// The parts of spans that are within the image.
void clip(std::span<const ColumnSpan> spans, const RunsView& image, Buffer<ColumnSpan>& result);
/// The pixels of spans, which are in the order of rows and columns.
void footprint(std::span<const ColumnSpan> spans, std::uint32_t columns, std::uint32_t rows, Runs& result);

/// Ended columns that share a side or a corner in plan view, in the same layer or in neighbouring ones, are one body.
/// Of its bodies `area` is the footprint, `tall` and `detached` parts of it, `pixel_nm` the volume.
class ColumnBodies {
 public:
  /// Takes what ended below this layer. tall_nm  height from which columns count as tall. Rules  as those of Follower::add()
  template <class Rules>
  void add(const Layer& layer, std::span<const ColumnSpan> ended, std::uint32_t columns, std::uint32_t rows,
           std::int64_t tall_nm, Rules& rules);
  template <class Rules>
  void finish(Rules& rules) {
    follower_.finish(rules);
  }
  bool is_idle() const { return follower_.is_idle(); }
  std::uint64_t bytes() const { return follower_.bytes() + bytes_of(footprint_) + bytes_of(grown_) + bytes_held(sums_); }

 private:
  struct PieceSum {
    std::uint64_t area = 0, tall = 0, detached = 0, pixel_nm = 0;
    std::int64_t bottom = INT64_MAX;
    std::uint32_t first_layer = UINT32_MAX;
  };
  /// Finds the pieces and what each of them sums up to.
  void find(const Layer& layer, std::span<const ColumnSpan> ended, std::uint32_t columns, std::uint32_t rows,
            std::int64_t tall_nm);

  Follower follower_{true};
  Runs footprint_, grown_;
  Buffer<PieceSum> sums_;  // by piece
};

template <class Rules>
void ColumnBodies::add(const Layer& layer, std::span<const ColumnSpan> ended, std::uint32_t columns, std::uint32_t rows,
                       std::int64_t tall_nm, Rules& rules) {
  if (ended.empty() && follower_.is_idle()) return;
  find(layer, ended, columns, rows, tall_nm);
  struct Counted {
    Rules& rules;
    const PieceSum* sum;
    std::int64_t top;
    void begin(Body&) {}
    void grow(Body& body) {
      // One pixel wider to the right and downwards, so that neighbours overlap.
      body.box.right -= 1;
      body.box.bottom -= 1;
      body.area = sum->area;
      body.tall = sum->tall;
      body.detached = sum->detached;
      body.pixel_nm = sum->pixel_nm;
      body.bottom = sum->bottom;
      body.first_layer = sum->first_layer;
      body.last_layer = body.last_layer > 0 ? body.last_layer - 1 : 0;
      body.top = top;
      ++sum;
    }
    void join(const Body&, const Body&, const Body&) {}
    void end(const Body& body) { rules.end(body); }
  } counted{rules, sums_.data(), layer.bottom};
  follower_.add(layer, grown_, counted);
}

}  // namespace lamina::checks
