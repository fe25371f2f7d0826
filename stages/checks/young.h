// stages/checks/young.h: vertical columns of pixels up to a height, followed upwards on runs. Taller ones are one image,
// without where they begin: near surfaces alone there are others. Where only the tall ones count, they are what the last layers
// share.
//
// Source: queues with the sum of their elements as two stacks, folklore; H. Tangwongsan et al., "General Incremental
// Sliding-Window Aggregation", VLDB 8(7), 2015, section 2.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/checks/columns.h"
#include "stages/data/buffer.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"

namespace lamina::checks {

class YoungColumns {
 public:
  /// Takes the next layer. from  columns that begin at this height or below are tall; no lower than before
  /// all_tall  all columns of the first layer are
  /// cost  O(runs + spans)
  void add(const Layer& layer, const RunsView& image, std::int64_t from, bool all_tall);
  /// Ends all columns.
  void finish();
  /// Columns that ended below the last layer that was added and were not tall, from the top row down, from the left.
  std::span<const ColumnSpan> ended() const { return ended_; }
  /// Columns that are tall.
  const Runs& tall() const { return tall_; }

  /// Bytes that it holds after add(), and what ends then. of_ended  bytes that the caller keeps of each span that ends
  std::uint64_t need(const RunsView& image, std::uint64_t of_ended) const {
    const std::uint64_t runs = image.change.size() / 2, spans = 2 * span_.size() + runs + tall_.change.size() / 2;
    return 2 * spans * sizeof(ColumnSpan) + span_.size() * (sizeof(ColumnSpan) + of_ended) + 16 * spans +
           4 * image.row_offset.size_bytes();
  }
  std::uint64_t bytes() const {
    return bytes_held(row_) + bytes_held(next_row_) + bytes_held(span_) + bytes_held(next_) + bytes_held(ended_) +
           bytes_of(tall_) + bytes_of(next_tall_);
  }

 private:
  void add_tall_row(std::span<const std::uint32_t> image, std::span<const std::uint32_t> old, const ColumnSpan& kind);
  void add_row(std::uint32_t row, std::span<const std::uint32_t> image, std::int64_t from, const ColumnSpan& kind);
  void keep(const ColumnSpan& span, std::uint32_t begin, std::uint32_t end, std::int64_t from);

  Runs tall_, next_tall_;
  Buffer<std::uint32_t> row_, next_row_;  // offsets of rows in spans
  Buffer<ColumnSpan> span_, next_, ended_;
};

/// The pixels that are set in all of the last layers, as many as a height takes.
class TallColumns {
 public:
  /// Takes the next layer. from  the lowest layer of the window is the last one that begins at this height or below, or the
  /// first of all; no lower than before. cost  O(runs) of about three layers on average, regardless of the height
  void add(const Layer& layer, const RunsView& image, std::int64_t from);
  const Runs& tall() const { return tall_; }

  /// Bytes that it holds after add().
  std::uint64_t need(const RunsView& image) const;
  std::uint64_t bytes() const;

 private:
  struct LayerImage {
    std::int64_t bottom = 0;
    Runs image;
  };
  void push(std::vector<LayerImage>& stack);
  std::int64_t second_bottom() const;

  // The window is lower_ and then upper_. lower_, whose last element is the lowest layer, holds what each layer shares with all
  // those of lower_ above it; upper_ holds layers.
  std::vector<LayerImage> lower_, upper_, unused_;
  Runs upper_all_, spare_, tall_;  // what the layers of upper_ share
};

}  // namespace lamina::checks
