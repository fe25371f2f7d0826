// stages/coverage/meet/box_tree.h: which boxes meet a box.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::cover {

constexpr bool boxes_touch(const Box& a, const Box& b) {
  return a.lo.x <= b.hi.x && b.lo.x <= a.hi.x && a.lo.y <= b.hi.y && b.lo.y <= a.hi.y && a.lo.z <= b.hi.z && b.lo.z <= a.hi.z;
}

/// Boxes halved at the median of their longest side, again and again. 28 bytes a box.
class BoxTree {
 public:
  /// cost  O(n log n)
  explicit BoxTree(std::span<const Box> boxes) : boxes_(boxes) {
    order_.resize(boxes.size());
    for (std::uint32_t i = 0; i < order_.size(); ++i) order_[i] = i;
    node_.resize(order_.empty() ? 1 : 2 * std::bit_ceil((order_.size() + kLeaf - 1) / kLeaf));
    build(1, 0, static_cast<std::uint32_t>(order_.size()));
  }

  /// Calls `see` with each that touches the box, in an order that depends on the boxes alone.
  template <class See>
  void each(const Box& box, See&& see) const {
    visit(1, 0, static_cast<std::uint32_t>(order_.size()), box, see);
  }

 private:
  static constexpr std::uint32_t kLeaf = 4;

  bool is_leaf(std::size_t node) const { return 2 * node >= node_.size(); }

  void build(std::size_t node, std::uint32_t begin, std::uint32_t end) {
    Box all;
    for (std::uint32_t i = begin; i < end; ++i) all.add(boxes_[order_[i]]);
    node_[node < node_.size() ? node : 0] = all;
    if (is_leaf(node)) return;
    const std::int64_t w = all.width(), d = all.depth(), h = all.height();
    const auto middle = [&](std::uint32_t i) {
      const Point3 m = boxes_[i].middle();
      return w >= d && w >= h ? m.x : d >= h ? m.y : m.z;
    };
    const std::uint32_t half = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) { return middle(a) != middle(b) ? middle(a) < middle(b) : a < b; });
    build(2 * node, begin, half);
    build(2 * node + 1, half, end);
  }

  template <class See>
  void visit(std::size_t node, std::uint32_t begin, std::uint32_t end, const Box& box, See&& see) const {
    if (begin >= end || !boxes_touch(node_[node < node_.size() ? node : 0], box)) return;
    if (is_leaf(node)) {
      for (std::uint32_t i = begin; i < end; ++i) {
        if (boxes_touch(boxes_[order_[i]], box)) see(order_[i]);
      }
      return;
    }
    const std::uint32_t half = begin + (end - begin) / 2;
    visit(2 * node, begin, half, box, see);
    visit(2 * node + 1, half, end, box, see);
  }

  std::span<const Box> boxes_;
  Buffer<std::uint32_t> order_;
  Buffer<Box> node_;
};

}  // namespace lamina::cover
