// stages/coverage/samples.h: winding numbers at 8 x 8 x 8 points a voxel, along 64 lines of a row.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/edges.h"
#include "stages/coverage/slab_facet.h"
#include "stages/coverage/voxel.h"
#include "stages/data/buffer.h"

namespace lamina::coverage {

/// Counts a stretch of columns at once; keeps its buffers.
class Samples {
 public:
  struct SampleCount {
    std::uint16_t solid = 0;   // samples that the fill rule calls solid
    std::uint16_t others = 0;  // samples whose winding number is neither 0 nor 1
  };

  /// Columns [first, end) of a row; before them the winding number is `winding`.
  /// stretch  facets that reach the columns; none reaches columns outside
  /// cost     64 lines a facet, one step a column and line
  void count(const Strip& strip, const PixelAxis& columns, const Edges& edges, std::int64_t winding, FillRule fill,
             std::span<const SlabFacet> facets, std::span<const RowFacet> span, std::uint32_t first, std::uint32_t end);

  const SampleCount& at(std::uint32_t column) const { return count_[column - first_]; }
  bool knows(std::uint32_t column) const { return column >= first_ && column < end_; }
  void forget() { first_ = end_ = 0; }
  std::uint64_t bytes() const { return bytes_held(crossing_) + bytes_held(count_); }

 private:
  /// Where a facet crosses a line: at or before that sample, counted from the first column.
  struct Crossing {
    std::uint32_t line;
    std::int32_t sign;
    std::uint64_t sample;
    friend bool operator<(const Crossing& a, const Crossing& b) {
      return a.line != b.line ? a.line < b.line : a.sample < b.sample;
    }
  };
  void cross(const SlabFacet& facet, const Strip& strip, const PixelAxis& columns, const Edges& edges);

  std::uint32_t first_ = 0, end_ = 0;
  Buffer<Crossing> crossing_;
  Buffer<SampleCount> count_;
};

}  // namespace lamina::coverage
