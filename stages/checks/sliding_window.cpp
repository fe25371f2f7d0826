#include "stages/checks/sliding_window.h"

#include <utility>

#include "stages/checks/bodies.h"  // copy_runs, bytes_of

namespace lamina::checks {

/// Buffers are copied, not swapped, so that an element has the capacity that it needs.
void SlidingWindow::include(const RunsView& image, Runs& result) {
  combine(result, image, operation_, spare_);
  copy_runs(spare_, result);
}

/// The first block becomes the one whose images are forgotten.
void SlidingWindow::open_oldest() {
  std::vector<Element>& elements = blocks_.front().elements;
  for (; !elements.empty(); elements.pop_back()) {
    oldest_.push_back(std::move(elements.back()));
    if (oldest_.size() > 1) include(oldest_[oldest_.size() - 2].image, oldest_.back().image);
  }
  blocks_.pop_front();
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    if (k == 0) {
      copy_runs(blocks_[k].all, later_);
    } else {
      include(blocks_[k].all, later_);
    }
  }
}

void SlidingWindow::add(std::int64_t position, const RunsView& image, std::int64_t from) {
  if (blocks_.empty()) {
    copy_runs(image, later_);
  } else {
    include(image, later_);
  }
  if (blocks_.empty() || blocks_.back().elements.size() * blocks_.back().elements.size() >= count_) {
    copy_runs(image, blocks_.emplace_back().all);
  } else {
    include(image, blocks_.back().all);
  }
  Element& element = blocks_.back().elements.emplace_back();
  element.position = position;
  copy_runs(image, element.image);
  for (++count_; count_ > 1; --count_) {
    if (oldest_.empty() && blocks_.front().elements.front().position <= from) open_oldest();
    if (oldest_.empty() || oldest_.back().position > from) break;
    oldest_.pop_back();
  }
  if (oldest_.empty()) {
    copy_runs(later_, combined_);
  } else if (blocks_.empty()) {
    copy_runs(oldest_.back().image, combined_);
  } else {
    combine(oldest_.back().image, later_, operation_, combined_);
  }
}

std::uint64_t SlidingWindow::need(const RunsView& image) const {
  const auto size = [](const RunsView& runs) { return runs.change.size_bytes() + runs.row_offset.size_bytes(); };
  std::uint64_t total = 6 * size(image) + 3 * size(later_);
  for (const Element& one : oldest_) total += size(one.image);
  for (const ImageBlock& block : blocks_) {
    total += size(block.all);
    for (const Element& one : block.elements) total += size(one.image);
  }
  return total;
}

std::uint64_t SlidingWindow::bytes() const {
  std::uint64_t total = bytes_of(later_) + bytes_of(spare_) + bytes_of(combined_);
  const auto count = [&](const std::vector<Element>& elements) {
    total += elements.capacity() * sizeof(Element);
    for (const Element& one : elements) total += bytes_of(one.image);
  };
  count(oldest_);
  for (const ImageBlock& block : blocks_) {
    total += sizeof(ImageBlock) + bytes_of(block.all);
    count(block.elements);
  }
  return total;
}

}  // namespace lamina::checks
