// stages/checks/sliding_window.h: the union or the intersection of the last images, as many as a window takes, for the cost of
// about five images regardless of their number.
//
// The window is a block of which each image is kept combined with those after it, so that the oldest one can be forgotten, and
// blocks of later images with their sums. A block has the square root of the window: so that the sums of unions, which may be
// as large as all of their images, take about as much memory as the images.
//
// Source: queues with the sum of their elements as two stacks, folklore; H. Tangwongsan et al., "General Incremental
// Sliding-Window Aggregation", VLDB 8(7), 2015, section 2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "stages/data/runs.h"
#include "stages/geometry/combine.h"

namespace lamina::checks {

class SlidingWindow {
 public:
  explicit SlidingWindow(SetOperation operation) : operation_(operation) {}

  /// Takes the next image, and forgets those before it whose position is at from or below.
  /// position  larger than those before; from  no lower than before; cost  O(runs + rows) of about five images on average
  void add(std::int64_t position, const RunsView& image, std::int64_t from);
  /// Of the images of the window.
  const Runs& combined() const { return combined_; }

  /// Bytes that it holds after add().
  std::uint64_t need(const RunsView& image) const;
  std::uint64_t bytes() const;

 private:
  struct Element {
    std::int64_t position = 0;
    Runs image;
  };
  struct ImageBlock {
    std::vector<Element> elements;
    Runs all;
  };
  void include(const RunsView& image, Runs& result);
  void open_oldest();

  SetOperation operation_;
  std::vector<Element> oldest_;    // combined with those after them of their block; the last one is the oldest
  std::deque<ImageBlock> blocks_;  // those after it, the oldest first
  std::size_t count_ = 0;          // of images
  Runs later_, spare_, combined_;  // all blocks_
};

}  // namespace lamina::checks
