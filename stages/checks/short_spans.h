// stages/checks/short_spans.h: vertical columns of pixels that are shorter than a height, where they end: those of material and
// those of the powder between it.
//
// Of the last layers, as many as the height takes, the images are kept. Where material moves steadily to one side it begins or
// ends no short column, and in most rows it does: there ends of runs are compared. Where the height takes many layers, columns
// that end are compared with what all of these layers share (recent_pixels.h), so that a layer costs the same for any height.
// What is left is cut into spans by a search backwards through the images.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "stages/checks/columns.h"
#include "stages/checks/recent_pixels.h"
#include "stages/data/buffer.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"

namespace lamina::checks {

class ShortSpans {
 public:
  /// height_nm  the least height that is not short
  explicit ShortSpans(std::int64_t height_nm) : height_nm_(height_nm) {}

  /// Takes the next layer. Columns of powder that begin with the first layer are never short.
  /// window  the pixels that have powder; cost  O(runs of the last layers that the height takes, at most of kMaxLayers, and the
  /// layers of the columns that end)
  void add(const Layer& layer, const RunsView& image, const PixelBox& window);
  /// Ends all columns of material below this layer; those of powder do not end.
  void finish(const Layer& above);
  /// Short columns of material and of powder that ended below the last layer, from the top row down, from the left.
  std::span<const ColumnSpan> solid() const { return solid_; }
  std::span<const ColumnSpan> powder() const { return powder_; }

  /// Bytes that it holds after add(), and what ends then. of_ended  bytes that the caller keeps of each span that ends
  std::uint64_t need(const RunsView& image, std::uint64_t of_ended) const;
  std::uint64_t bytes() const;

  static constexpr std::size_t kMaxLayers = 8;

 private:
  struct Below {
    Layer layer{};
    Runs image;
  };
  struct Range {
    std::uint32_t begin, end;
  };
  void forget(const Layer& layer);
  void end_rows(const Layer& layer, const RunsView& image, const PixelBox& window);
  bool steady(std::uint32_t row, std::span<const std::uint32_t> image, bool tall) const;
  void cut(std::uint32_t row, bool set, bool endless, Buffer<ColumnSpan>& result);
  void end_row(std::uint32_t row, std::span<const std::uint32_t> image, bool tall, const PixelBox& window);
  void keep_within(std::span<const std::uint32_t> image);
  void keep_outside(std::span<const std::uint32_t> image);

  std::int64_t height_nm_;
  std::deque<Below> below_;  // the last layers, the lowest first; of layers in sequence with equal images the first one
  std::vector<Below> unused_;
  RecentPixels recent_;  // of layers that include below_; empty while these are few
  Buffer<ColumnSpan> solid_, powder_;
  Buffer<Range> ending_, rest_;  // of a row
};

}  // namespace lamina::checks
