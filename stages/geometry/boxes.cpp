#include "stages/geometry/boxes.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace lamina {
namespace {

/// Groups boxes by a tree of the boxes around their halves, split along the longest side. Two halves are compared until they
/// are known to be one group.
class Grouping {
 public:
  explicit Grouping(std::span<const Box> boxes) : boxes_(boxes), root_(boxes.size()) {
    std::iota(root_.begin(), root_.end(), 0u);
    for (std::uint32_t i = 0; i < boxes.size(); ++i)
      if (!boxes[i].empty()) order_.push_back(i);
    if (!order_.empty()) build(0, static_cast<std::uint32_t>(order_.size()));
  }
  std::uint32_t find(std::uint32_t i) {
    while (root_[i] != i) i = root_[i] = root_[root_[i]];
    return i;
  }
  std::uint64_t compared = 0;

 private:
  struct Node {
    Box around;
    std::uint32_t first, left, right;  // a box; children, none of a leaf
    bool one;                          // group alone
    bool leaf() const { return left == right; }
  };

  std::uint32_t build(std::uint32_t begin, std::uint32_t end) {
    Box around;
    for (std::uint32_t i = begin; i < end; ++i) around.add(boxes_[order_[i]]);
    if (end - begin == 1) {
      nodes_.push_back({around, order_[begin], 0, 0, true});
      return static_cast<std::uint32_t>(nodes_.size() - 1);
    }
    const std::int64_t longest = std::max({around.width(), around.depth(), around.height()});
    const auto axis = longest == around.width() ? &Point3::x : longest == around.depth() ? &Point3::y : &Point3::z;
    const auto key = [&](std::uint32_t i) { return std::pair(std::int64_t{boxes_[i].lo.*axis} + boxes_[i].hi.*axis, i); };
    const std::uint32_t middle = begin + (end - begin) / 2;
    std::ranges::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end, {}, key);
    const std::uint32_t left = build(begin, middle), right = build(middle, end);
    join(left, right);
    nodes_.push_back({around, nodes_[left].first, left, right, false});
    is_one(nodes_.back());
    return static_cast<std::uint32_t>(nodes_.size() - 1);
  }
  bool is_one(Node& node) {
    if (!node.one)
      node.one =
          nodes_[node.left].one && nodes_[node.right].one && find(nodes_[node.left].first) == find(nodes_[node.right].first);
    return node.one;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    ++compared;
    Node &one = nodes_[a], &other = nodes_[b];
    if (!touch(one.around, other.around)) return;
    const std::uint32_t i = find(one.first), j = find(other.first);
    if (i == j && is_one(one) && is_one(other)) return;
    if (one.leaf() && other.leaf()) {
      root_[std::max(i, j)] = std::min(i, j);
      return;
    }
    const auto size = [](const Node& node) { return node.around.width() + node.around.depth() + node.around.height(); };
    const bool descend = other.leaf() || (!one.leaf() && size(one) >= size(other));
    const Node& halved = descend ? one : other;
    const std::uint32_t left = halved.left, right = halved.right, whole = descend ? b : a;
    join(left, whole);
    join(right, whole);
  }

  std::span<const Box> boxes_;
  std::vector<std::uint32_t> root_, order_;
  std::vector<Node> nodes_;
};

}  // namespace

bool touch(const Box& a, const Box& b) {
  return !a.empty() && !b.empty() && a.lo.x <= b.hi.x && b.lo.x <= a.hi.x && a.lo.y <= b.hi.y && b.lo.y <= a.hi.y &&
         a.lo.z <= b.hi.z && b.lo.z <= a.hi.z;
}

std::vector<std::uint32_t> group_touching(std::span<const Box> boxes, std::uint64_t* compared) {
  Grouping grouping(boxes);
  if (compared != nullptr) *compared = grouping.compared;
  std::vector<std::uint32_t> group(boxes.size()), number(boxes.size(), UINT32_MAX);
  std::uint32_t groups = 0;
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    std::uint32_t& own = number[grouping.find(i)];
    if (own == UINT32_MAX) own = groups++;
    group[i] = own;
  }
  return group;
}

bool for_each_overlap(std::span<const Box> boxes, const std::function<bool(std::uint32_t, std::uint32_t)>& visit) {
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < boxes.size(); ++i)
    if (!boxes[i].empty()) order.push_back(i);
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return std::pair(boxes[i].lo.x, i); });
  std::uint64_t left = std::uint64_t{1} << 26;
  for (auto one = order.begin(); one != order.end(); ++one) {
    const Box& a = boxes[*one];
    for (auto other = one + 1; other != order.end() && boxes[*other].lo.x < a.hi.x; ++other) {
      if (left-- == 0) return false;
      const Box& b = boxes[*other];
      if (a.lo.y >= b.hi.y || b.lo.y >= a.hi.y || a.lo.z >= b.hi.z || b.lo.z >= a.hi.z) continue;
      if (!visit(*one, *other)) return true;
    }
  }
  return true;
}

}  // namespace lamina
