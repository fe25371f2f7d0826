#include "stages/checks/recent_pixels.h"

#include <algorithm>
#include <utility>

#include "stages/checks/bodies.h"  // copy_runs, bytes_of
#include "stages/geometry/combine.h"

namespace lamina::checks {
namespace {

constexpr std::size_t kBlocks = 4;  // of a height

/// Buffers are copied, not swapped, so that each has the capacity that it needs.
void include(const RunsView& image, SetOperation operation, Runs& result, Runs& spare) {
  combine(result, image, operation, spare);
  copy_runs(spare, result);
}

}  // namespace

void RecentPixels::add_block(const LayerBlock& block) {
  include(block.all, SetOperation::kIntersection, all_, spare_);
  include(block.any, SetOperation::kUnion, any_, spare_);
}

void RecentPixels::forget(std::int64_t from_nm, std::size_t layers) {
  block_layers_ = std::max<std::size_t>(1, layers / kBlocks);
  const std::size_t before = blocks_.size();
  while (blocks_.size() > 1 && blocks_[1].bottom <= from_nm) {
    unused_.push_back(std::move(blocks_.front()));
    blocks_.pop_front();
  }
  if (blocks_.size() == before) return;
  copy_runs(blocks_[0].all, all_);
  copy_runs(blocks_[0].any, any_);
  for (std::size_t k = 1; k < blocks_.size(); ++k) add_block(blocks_[k]);
}

void RecentPixels::add(const Layer& layer, const RunsView& image) {
  if (blocks_.empty()) {
    copy_runs(image, all_);
    copy_runs(image, any_);
  } else {
    include(image, SetOperation::kIntersection, all_, spare_);
    include(image, SetOperation::kUnion, any_, spare_);
  }
  if (blocks_.empty() || blocks_.back().layers >= block_layers_) {
    if (unused_.empty()) unused_.emplace_back();
    blocks_.push_back(std::move(unused_.back()));
    unused_.pop_back();
    LayerBlock& block = blocks_.back();
    block.bottom = layer.bottom;
    block.layers = 1;
    copy_runs(image, block.all);
    copy_runs(image, block.any);
    return;
  }
  LayerBlock& block = blocks_.back();
  ++block.layers;
  include(image, SetOperation::kIntersection, block.all, spare_);
  include(image, SetOperation::kUnion, block.any, spare_);
}

std::uint64_t RecentPixels::need(const RunsView& image) const {
  const auto size = [](const RunsView& runs) { return runs.change.size_bytes() + runs.row_offset.size_bytes(); };
  std::uint64_t total = 8 * size(image) + 2 * (size(all_) + size(any_));
  for (const LayerBlock& block : blocks_) total += size(block.all) + size(block.any);
  return total;
}

std::uint64_t RecentPixels::bytes() const {
  std::uint64_t total = bytes_of(all_) + bytes_of(any_) + bytes_of(spare_) + blocks_.size() * sizeof(LayerBlock) +
                        unused_.capacity() * sizeof(LayerBlock);
  for (const LayerBlock& block : blocks_) total += bytes_of(block.all) + bytes_of(block.any);
  for (const LayerBlock& block : unused_) total += bytes_of(block.all) + bytes_of(block.any);
  return total;
}

}  // namespace lamina::checks
