#include "stages/geometry/contours/monotone.h"

#include <algorithm>

#include "stages/geometry/contours/meet.h"

namespace lamina {
namespace {

int sign(std::int64_t v) { return v > 0 ? 1 : v < 0 ? -1 : 0; }

class Search {
 public:
  Search(const ContoursView& contours, MonotoneScratch& scratch)
      : contours_(contours),
        scratch_(scratch),
        most_chains_(32 + contours.point.size() / 6),
        comparisons_left_(4096 + 8 * static_cast<std::int64_t>(contours.point.size())) {}

  bool run() {
    scratch_.chain.clear();
    scratch_.contact.clear();
    for (std::uint32_t c = 0; c < contours_.size(); ++c) {
      split(c);
      if (scratch_.chain.size() > most_chains_) return false;
    }
    auto& chains = scratch_.chain;
    std::sort(chains.begin(), chains.end(), [](const MonotoneChain& a, const MonotoneChain& b) { return a.lo.x < b.lo.x; });
    auto& open = scratch_.open;
    open.clear();
    for (std::uint32_t i = 0; i < chains.size(); ++i) {
      const MonotoneChain& own = chains[i];
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
  void split(std::uint32_t c) {
    const std::uint32_t begin = contours_.offset[c], end = contours_.offset[c + 1];
    MonotoneChain chain{c, begin, 0, {}, {}};
    int along_x = 0, along_y = 0;
    const auto finish = [&](std::uint32_t next) {
      if (chain.edges > 0) {
        const Point2 a = point(chain, 0), b = point(chain, chain.edges);
        chain.lo = {std::min(a.x, b.x), std::min(a.y, b.y)};
        chain.hi = {std::max(a.x, b.x), std::max(a.y, b.y)};
        scratch_.chain.push_back(chain);
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
      return stretches_meet(a_from, a_to, b_from, b_to);
    }
    if (a1 - a0 >= b1 - b0) {
      const std::uint32_t middle = a0 + (a1 - a0) / 2;
      return meet(a, a0, middle, b, b0, b1) || meet(a, middle, a1, b, b0, b1);
    }
    const std::uint32_t middle = b0 + (b1 - b0) / 2;
    return meet(a, a0, a1, b, b0, middle) || meet(a, a0, a1, b, middle, b1);
  }

  const ContoursView& contours_;
  MonotoneScratch& scratch_;
  std::size_t most_chains_;
  std::int64_t comparisons_left_;
};

}  // namespace

bool find_monotone_contacts(const ContoursView& contours, MonotoneScratch& scratch) { return Search(contours, scratch).run(); }

}  // namespace lamina
