#include "stages/geometry/contours/contact.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace lamina {
namespace {

class ContactSearch {
 public:
  ContactSearch(const ContoursView& contours, ContactScratch& scratch)
      : contours_(contours),
        scratch_(scratch),
        max_chains_(32 + contours.point.size() / 6),
        comparisons_left_(4096 + 8 * static_cast<std::int64_t>(contours.point.size())) {}

  bool run() {
    scratch_.chain.clear();
    scratch_.contact.clear();
    scratch_.box.clear();
    for (std::uint32_t c = 0; c < contours_.size(); ++c) {
      split(c);
      if (scratch_.chain.size() > max_chains_) return false;
    }
    auto& chains = scratch_.chain;
    scratch_.region.resize(contours_.size());
    separate(scratch_.box, &Point2::x, &Point2::y, kSeparations, false);
    for (MonotoneChain& chain : chains) chain.region = scratch_.region[chain.contour];
    std::sort(chains.begin(), chains.end(), [](const MonotoneChain& a, const MonotoneChain& b) {
      return a.region != b.region ? a.region < b.region : a.lo.x < b.lo.x;
    });
    auto& open = scratch_.open;
    open.clear();
    for (std::uint32_t i = 0; i < chains.size(); ++i) {
      const MonotoneChain& own = chains[i];
      if (i > 0 && chains[i - 1].region != own.region) open.clear();
      std::size_t kept = 0;
      comparisons_left_ -= static_cast<std::int64_t>(open.size());
      for (const std::uint32_t other : open) {
        const MonotoneChain& before = chains[other];
        if (before.hi.x < own.lo.x) continue;
        open[kept++] = other;
        if (before.lo.y > own.hi.y || own.lo.y > before.hi.y) continue;
        if (meet(before, 0, before.edges, own, 0, own.edges)) scratch_.contact.emplace_back(before.contour, own.contour);
        if (comparisons_left_ < 0) return false;
      }
      open.resize(kept);
      open.push_back(i);
    }
    return true;
  }

 private:
  static constexpr int kSeparations = 8;

  /// Numbers the regions of contours that lines across one axis separate, then lines across the other one.
  /// undivided  no line across the other axis separates any of them
  void separate(std::span<ContourBox> boxes, Nm Point2::*across, Nm Point2::*along, int separations, bool undivided) {
    std::sort(boxes.begin(), boxes.end(),
              [across](const ContourBox& a, const ContourBox& b) { return a.lo.*across < b.lo.*across; });
    for (std::size_t begin = 0, end = 0; begin < boxes.size(); begin = end) {
      Nm reach = boxes[begin].hi.*across;
      for (end = begin + 1; end < boxes.size() && boxes[end].lo.*across <= reach; ++end)
        reach = std::max(reach, boxes[end].hi.*across);
      const bool all = end - begin == boxes.size();
      if (separations > 0 && end - begin > 1 && !(all && undivided)) {
        separate(boxes.subspan(begin, end - begin), along, across, separations - 1, all);
        continue;
      }
      for (std::size_t i = begin; i < end; ++i) scratch_.region[boxes[i].contour] = regions_;
      ++regions_;
    }
  }

  void split(std::uint32_t c) {
    ContourBox box{{INT32_MAX, INT32_MAX}, {INT32_MIN, INT32_MIN}, c};
    const std::uint32_t begin = contours_.offset[c], end = contours_.offset[c + 1];
    MonotoneChain chain{c, begin, 0, {}, {}};
    int along_x = 0, along_y = 0;
    const auto finish = [&](std::uint32_t next) {
      if (chain.edges > 0) {
        const Point2 a = point(chain, 0), b = point(chain, chain.edges);
        chain.lo = {std::min(a.x, b.x), std::min(a.y, b.y)};
        chain.hi = {std::max(a.x, b.x), std::max(a.y, b.y)};
        scratch_.chain.push_back(chain);
        box.lo = {std::min(box.lo.x, chain.lo.x), std::min(box.lo.y, chain.lo.y)};
        box.hi = {std::max(box.hi.x, chain.hi.x), std::max(box.hi.y, chain.hi.y)};
      }
      chain.begin = next;
      chain.edges = 0;
      along_x = along_y = 0;
    };
    for (std::uint32_t i = begin; i < end; ++i) {
      const Point2 a = contours_.point[i], b = contours_.point[i + 1 == end ? begin : i + 1];
      const int x = sign(std::int64_t{b.x} - a.x), y = sign(std::int64_t{b.y} - a.y);
      // A repeated point goes neither way: the edges around it are no neighbours, and have to be compared.
      if (x * along_x < 0 || y * along_y < 0 || (x == 0 && y == 0)) finish(i);
      if (x != 0) along_x = x;
      if (y != 0) along_y = y;
      ++chain.edges;
      if (x == 0 && y == 0) finish(i + 1);
    }
    finish(end);
    scratch_.box.push_back(box);
  }

  Point2 point(const MonotoneChain& chain, std::uint32_t k) const { return contours_.point[index(chain, k)]; }
  std::uint32_t index(const MonotoneChain& chain, std::uint32_t k) const {
    const std::uint32_t i = chain.begin + k;  // a chain is no longer than its contour, and ends at its first point at most
    return i == contours_.offset[chain.contour + 1] ? contours_.offset[chain.contour] : i;
  }

  /// Whether edges [a0, a1) of chain a meet edges [b0, b1) of chain b other than as neighbours.
  bool meet(const MonotoneChain& a, std::uint32_t a0, std::uint32_t a1, const MonotoneChain& b, std::uint32_t b0,
            std::uint32_t b1) {
    --comparisons_left_;
    if (comparisons_left_ < 0) return false;
    const Point2 a_from = point(a, a0), a_to = point(a, a1), b_from = point(b, b0), b_to = point(b, b1);
    if (!boxes_meet(a_from, a_to, b_from, b_to)) return false;
    if (a1 - a0 == 1 && b1 - b0 == 1) {
      if (a.contour == b.contour) {
        const std::uint32_t ia = index(a, a0), ib = index(b, b0);
        if (index(a, a1) == ib || index(b, b1) == ia) return false;
      }
      return intervals_meet(a_from, a_to, b_from, b_to);
    }
    if (a1 - a0 >= b1 - b0) {
      const std::uint32_t middle = a0 + (a1 - a0) / 2;
      return meet(a, a0, middle, b, b0, b1) || meet(a, middle, a1, b, b0, b1);
    }
    const std::uint32_t middle = b0 + (b1 - b0) / 2;
    return meet(a, a0, a1, b, b0, middle) || meet(a, a0, a1, b, middle, b1);
  }

  const ContoursView& contours_;
  ContactScratch& scratch_;
  std::size_t max_chains_;
  std::int64_t comparisons_left_;
  std::uint32_t regions_ = 0;
};

/// Square cells of 2^shift nm over the box of all points.
struct CellGrid {
  std::int64_t x0, y0;
  std::uint32_t shift;
  std::uint32_t columns, rows;

  std::int64_t column(std::int64_t x) const { return (x - x0) >> shift; }
  std::int64_t row(std::int64_t y) const { return (y - y0) >> shift; }

  /// Calls act(cell) for every cell that the stretch ab touches, and at most a few more.
  template <class Act>
  void for_each_cell(Point2 a, Point2 b, Act&& act) const {
    if (a.y > b.y) std::swap(a, b);
    const std::int64_t first = row(a.y), last = row(b.y);
    const auto put = [&](std::int64_t r, std::int64_t from, std::int64_t to) {
      for (std::int64_t c = from; c <= to; ++c) act(static_cast<std::size_t>(r * columns + c));
    };
    const std::int64_t low = std::min(column(a.x), column(b.x)), high = std::max(column(a.x), column(b.x));
    if (first == last || low == high) {
      for (std::int64_t r = first; r <= last; ++r) put(r, low, high);
      return;
    }
    const double slope = (static_cast<double>(b.x) - a.x) / (static_cast<double>(b.y) - a.y);
    for (std::int64_t r = first; r <= last; ++r) {
      // Where the stretch is while in this row, and 2 nm more than rounding can move it.
      const double from_y = static_cast<double>(std::max<std::int64_t>(y0 + (r << shift), a.y) - a.y);
      const double to_y = static_cast<double>(std::min<std::int64_t>(y0 + ((r + 1) << shift), b.y) - a.y);
      double from_x = a.x + slope * from_y, to_x = a.x + slope * to_y;
      if (from_x > to_x) std::swap(from_x, to_x);
      put(r, std::max(low, column(static_cast<std::int64_t>(from_x) - 2)),
          std::min(high, column(static_cast<std::int64_t>(to_x) + 2)));
    }
  }
};

CellGrid make_grid(const ContoursView& contours) {
  Point2 lo = contours.point[0], hi = lo;
  double length = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 before = contours[c].back();
    for (const Point2 p : contours[c]) {
      lo = {std::min(lo.x, p.x), std::min(lo.y, p.y)};
      hi = {std::max(hi.x, p.x), std::max(hi.y, p.y)};
      length += std::abs(static_cast<double>(p.x) - before.x) + std::abs(static_cast<double>(p.y) - before.y);
      before = p;
    }
  }
  CellGrid grid{lo.x, lo.y, 0, 0, 0};
  const auto edges = static_cast<double>(contours.point.size());
  const auto width = static_cast<double>(std::int64_t{hi.x} - lo.x), height = static_cast<double>(std::int64_t{hi.y} - lo.y);
  // As long as an edge on average, but no more than two cells an edge.
  double cell = std::max(length / edges, std::sqrt(width * height / (2 * edges)));
  while (static_cast<double>(1ull << grid.shift) < cell && grid.shift < 31) ++grid.shift;
  grid.columns = static_cast<std::uint32_t>(grid.column(hi.x)) + 1;
  grid.rows = static_cast<std::uint32_t>(grid.row(hi.y)) + 1;
  return grid;
}

}  // namespace

bool find_monotone_contacts(const ContoursView& contours, ContactScratch& scratch) {
  return ContactSearch(contours, scratch).run();
}

bool find_contacts(const ContoursView& contours, ContactScratch& scratch, Buffer<std::uint32_t>& group) {
  group.assign(contours.size(), kNoContact);
  if (contours.size() == 0) return false;
  const std::span<const Point2> point = contours.point;
  scratch.root.resize(contours.size());
  for (std::uint32_t c = 0; c < contours.size(); ++c) scratch.root[c] = c;
  const auto root_of = [&](std::uint32_t c) {
    while (scratch.root[c] != c) c = scratch.root[c] = scratch.root[scratch.root[c]];
    return c;
  };
  const auto join = [&](std::uint32_t a, std::uint32_t b) {
    const std::uint32_t one = root_of(a), other = root_of(b);
    scratch.root[std::max(one, other)] = std::min(one, other);
    group[a] = group[b] = 0;  // in some group
  };
  const auto number_groups = [&] {
    for (std::uint32_t c = 0; c < contours.size(); ++c) {
      if (group[c] != kNoContact) group[c] = root_of(c);
    }
  };
  if (find_monotone_contacts(contours, scratch)) {
    for (const auto& [a, b] : scratch.contact) join(a, b);
    number_groups();
    return !scratch.contact.empty();
  }
  scratch.next.resize(point.size());
  scratch.contour.resize(point.size());
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    for (std::uint32_t i = contours.offset[c]; i + 1 < contours.offset[c + 1]; ++i) scratch.next[i] = i + 1;
    scratch.next[contours.offset[c + 1] - 1] = contours.offset[c];
    std::fill(scratch.contour.begin() + contours.offset[c], scratch.contour.begin() + contours.offset[c + 1], c);
  }
  const CellGrid grid = make_grid(contours);
  const std::size_t cells = std::size_t{grid.columns} * grid.rows;
  scratch.offset.assign(cells + 1, 0);
  for (std::uint32_t i = 0; i < point.size(); ++i) {
    grid.for_each_cell(point[i], point[scratch.next[i]], [&](std::size_t cell) { ++scratch.offset[cell]; });
  }
  std::uint32_t total = 0;
  for (std::uint32_t& offset : scratch.offset) total += std::exchange(offset, total);
  scratch.edge.resize(total);
  // An edge is compared with those that came into its cells before it.
  Buffer<std::uint32_t>& position = scratch.offset;
  const auto begin_of = [&](std::size_t cell) { return cell == 0 ? 0u : position[cell - 1]; };
  for (std::uint32_t i = 0; i < point.size(); ++i) {
    const Point2 a = point[i], b = point[scratch.next[i]];
    grid.for_each_cell(a, b, [&](std::size_t cell) { scratch.edge[position[cell]++] = i; });
  }
  bool any = false;
  for (std::size_t cell = 0; cell < cells; ++cell) {
    const std::uint32_t end = position[cell];
    for (std::uint32_t k = begin_of(cell); k + 1 < end; ++k) {
      const std::uint32_t i = scratch.edge[k], after = scratch.next[i];
      const Point2 a = point[i], b = point[after];
      for (std::uint32_t m = k + 1; m < end; ++m) {
        const std::uint32_t j = scratch.edge[m];
        if (j == after || scratch.next[j] == i || j == i) continue;
        if (!intervals_meet(a, b, point[j], point[scratch.next[j]])) continue;
        join(scratch.contour[i], scratch.contour[j]);
        any = true;
      }
    }
  }
  number_groups();
  return any;
}

}  // namespace lamina
