// stages/checks/short_spans.h: vertical columns of pixels that are shorter than a height, where they end: those of material and
// those of the powder between it.
//
// Of the last layers, as many as the height takes, the images are kept. Where material moves steadily to one side it begins or
// ends no short column, and in most rows it does: ends of runs are compared, and only the other rows are cut into spans. Where
// the height takes many layers, columns are followed one by one (young.h): then each layer costs the same.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stages/checks/columns.h"
#include "stages/checks/young.h"
#include "stages/data/buffer.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"

namespace lamina::checks {

class ShortSpans {
 public:
  /// height_nm  the least height that is not short
  explicit ShortSpans(std::int64_t height_nm) : height_nm_(height_nm) {}

  /// Takes the next layer. powder  the pixels of the window that the image does not set; those of the first layer are never
  /// short. cost  O(runs of the last layers that the height takes, at most kMaxLayers)
  void add(const Layer& layer, const RunsView& image, const RunsView& powder, const PixelBox& window);
  /// Ends all columns of material below this layer; those of powder do not end.
  void finish(const Layer& above);
  /// Columns of material and of powder that ended below the last layer, from the top row down, from the left; where columns are
  /// followed one by one also some that are not short.
  std::span<const ColumnSpan> solid() const { return young_ ? young_->solid.ended() : std::span<const ColumnSpan>(solid_); }
  std::span<const ColumnSpan> powder() const { return young_ ? young_->powder.ended() : std::span<const ColumnSpan>(powder_); }

  /// Bytes that it holds after add(), and what ends then. of_ended  bytes that the caller keeps of each span that ends
  std::uint64_t need(const RunsView& image, const RunsView& powder, std::uint64_t of_ended) const;
  std::uint64_t bytes() const;

  static constexpr std::size_t kMaxLayers = 8;

 private:
  struct Below {
    Layer layer{};
    Runs image;
  };
  struct Followed {
    YoungColumns solid, powder;
  };
  struct Range {
    std::uint32_t begin, end;
  };
  void end_rows(const Layer& layer, const RunsView& image, const PixelBox& window);
  bool steady(std::uint32_t row, std::span<const std::uint32_t> image, bool tall) const;
  void cut(std::uint32_t row, bool set, bool endless, Buffer<ColumnSpan>& result);
  void follow(const Layer& next, const PixelBox& window);

  std::int64_t height_nm_;
  std::vector<Below> below_;  // the last layers, the lowest first
  std::vector<Below> unused_;
  std::optional<Followed> young_;
  Buffer<ColumnSpan> solid_, powder_;
  Buffer<Range> ending_, rest_;  // of a row
};

}  // namespace lamina::checks
