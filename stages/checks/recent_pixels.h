// stages/checks/recent_pixels.h: pixels that are set in all of the last layers, and in any of them.
//
// Layers are grouped into blocks, about four to a height, and what the layers of a block share is kept instead of the layers.
// So the oldest layer is up to a quarter of the height older than it has to be, and a layer costs as much for any height.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/runs.h"

namespace lamina::checks {

class RecentPixels {
 public:
  /// Forgets the oldest block while the block above it begins at this height or below. layers  that the height takes
  void forget(std::int64_t from_nm, std::size_t layers);
  /// Takes the next layer. cost  O(runs)
  void add(const Layer& layer, const RunsView& image);

  bool empty() const { return blocks_.empty(); }
  /// nm above the bed: the bottom of the oldest layer; not empty.
  std::int64_t bottom() const { return blocks_.front().bottom; }
  RunsView all() const { return all_; }
  RunsView any() const { return any_; }

  /// Bytes that it holds after add().
  std::uint64_t need(const RunsView& image) const;
  std::uint64_t bytes() const;

 private:
  struct LayerBlock {
    std::int64_t bottom = 0;
    std::size_t layers = 0;
    Runs all, any;
  };
  void add_block(const LayerBlock& block);

  std::deque<LayerBlock> blocks_;  // the oldest first
  std::vector<LayerBlock> unused_;
  std::size_t block_layers_ = 1;
  Runs all_, any_, spare_;
};

}  // namespace lamina::checks
