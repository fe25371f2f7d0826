// stages/checks/simple_chains.h: runs of consecutive rows of which each shares columns with one run above and one below alone,
// and where a stencil is within an image along them.
//
// A stencil whose rows share columns and that is within the image, and on a run of a simple chain in rows of that chain alone,
// is within the chain. So along a chain the positions of stencils are one interval a row, whose ends are sums of the ends of
// runs in a sliding window; of all chains at once, in registers. What is left are rows near the ends of chains and near places
// that are too narrow: those are given to chains of any form (chains.h), with the runs around them.
//
// Source: M. van Herk, Pattern Recognition Letters 13(7), 1992, section 1; P. Soille, Morphological Image Analysis, 2nd ed.,
// Springer 2003, chapter 3.
// cost    O(runs log rows of the stencil), about a nanosecond a run, and that of chains.h for the rest
#pragma once

#include <cstdint>

#include "stages/checks/chains.h"
#include "stages/data/buffer.h"
#include "stages/data/runs.h"

namespace lamina::checks {

/// Kept from image to image.
class SimpleChains {
 public:
  void find(const RunsView& image);

  // --- after find(), of a stencil of two rows or more whose neighbouring rows share columns. returns  whether that pays
  /// Finds the pixels that the stencil covers nowhere where it is within the image, but for rows that it leaves open.
  bool open(const StencilSteps& stencil);
  /// Finds the top left corners of all positions of the stencil within the image, but for those that it leaves open.
  bool erode(const StencilSteps& stencil);

  // --- after one of them
  /// The runs that decide on what is left open: for those rows the rest of the image might as well be empty. Rows without any
  /// are left out, but for an empty one where others are.
  void context(const RunsView& image, Runs& result);
  /// All that was found, and what belongs to rows that were left open. of_context  the same result of context()
  /// shift  columns from a run of the result to a pixel of the run that it belongs to
  void finish(const RunsView& image, const RunsView& context, const RunsView& of_context, std::uint32_t shift, Runs& result);

  std::uint64_t bytes() const;

 private:
  struct Chain {
    std::uint32_t row, length;
    std::size_t at;  // of its runs in the arrays
  };
  struct ChainPart {
    std::uint32_t row, begin, end;
    std::uint32_t open;  // of a context: as open_
  };
  void link(const RunsView& image, std::uint32_t row);
  void slide(const StencilSteps& stencil);
  void leave(const Chain& chain, std::int64_t first, std::int64_t last, std::int64_t reach);
  void sort_found(std::uint32_t rows);

  Buffer<std::uint32_t> of_run_;  // chain of each run
  Buffer<Chain> chain_;
  Buffer<std::int32_t> left_, right_;  // ends of runs, by chain; left ones negated
  Buffer<std::int32_t> first_, last_;  // corners, by the row of their stencil's top; first ones negated
  Buffer<std::int32_t> begin_, end_;   // what the stencil covers, in rows a stencil further down; columns less the end
  Buffer<std::int32_t> held_;          // of a block
  Buffer<std::uint8_t> open_;          // by chain: 1 the row is left open, 2 it belongs to the context
  Buffer<std::uint8_t> of_context_;    // the same, by run of the context
  Buffer<std::uint32_t> rows_;         // of the image, by row of the context
  Buffer<std::uint32_t> touched_, next_;
  Buffer<ChainPart> found_, kept_, sorted_;
  bool erodes_ = false;
  std::uint32_t rows_of_stencil_ = 0;
};

}  // namespace lamina::checks
