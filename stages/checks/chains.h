// stages/checks/chains.h: runs of consecutive rows that share columns, as chains, and what a stencil covers along them.
//
// Along a chain the left ends are one array and the right ends another. The union of a stencil's copies at all pixels of a
// chain is one run a row, whose ends are the minima and maxima of those arrays in sliding windows, each with the stencil's
// offset. A stencil is a sum of segments, so that windows of a power of two rows, doubled, make each of them.
//
// Source: minima in windows by doubling, M. van Herk, Pattern Recognition Letters 13(7), 1992, section 1; sums of segments,
// P. Soille, Morphological Image Analysis, 2nd ed., Springer 2003, chapter 3.
// cost    O(runs log rows of the stencil), independent of its width
#pragma once

#include <cstddef>
#include <cstdint>

#include "stages/checks/bodies.h"
#include "stages/checks/windows.h"
#include "stages/data/buffer.h"
#include "stages/data/runs.h"

namespace lamina::checks {

/// Kept from image to image.
class Chains {
 public:
  /// Divides the runs into chains. returns  whether they are so long that spread() pays for stencils of so many rows at most
  bool find(const RunsView& image, std::uint32_t stencil_rows);

  /// After find(), of any number of stencils: all pixels of the stencils whose top left corners are set or, with `corners`, the
  /// corners of all stencils that contain a set pixel. Within the window; with `gaps`, the pixels of the window between them.
  void spread(const StencilSteps& stencil, bool corners, const PixelBox& window, bool gaps, Runs& result);

  std::uint64_t bytes() const;

 private:
  struct Chain {
    std::uint32_t row, length;
    std::size_t at;      // of the ends of its runs
    std::size_t spread;  // of those of what the stencil covers
  };
  /// A chain that rows of the output meet.
  struct Active {
    std::ptrdiff_t at;  // of row 0 in the arrays
    std::int64_t end;
  };

  /// Columns of the window, and how far ends of rows are from those of the arrays.
  struct RowEdges {
    std::int32_t left, right, to_left, to_right;
  };

  std::uint32_t* fill_row(std::uint32_t row, const RowEdges& edges, bool gaps, std::uint32_t* to) const;
  void enter(std::int64_t row, std::int64_t shift, std::size_t& next);

  StencilSteps stencil_;
  std::uint32_t columns_ = 0, rows_ = 0;
  Buffer<std::uint32_t> of_run_;
  Buffer<Chain> chain_;
  Buffer<std::int32_t> end_left_, end_right_;  // of runs, by chain; right ends negated
  Buffer<std::int32_t> left_, less_right_;     // of what the stencil covers
  Buffer<std::int32_t> one_, other_;           // scratch
  Buffer<Active> active_, begin_;
};

}  // namespace lamina::checks
