// stages/load/repair/matches.cpp: ends of open edges in cells of space, each looked up from its neighbours.
#include "stages/load/repair/matches.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

namespace lamina::load {
namespace {

using Vector = std::array<double, 3>;

Vector between(const Point3& from, const Point3& to) {
  return {static_cast<double>(to.x) - from.x, static_cast<double>(to.y) - from.y, static_cast<double>(to.z) - from.z};
}
double dot(const Vector& u, const Vector& v) { return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]; }
double squared(const Point3& p, const Point3& q) {
  const Vector u = between(p, q);
  return dot(u, u);
}

/// Square of the distance from a point to a stretch between two others.
double squared_to_segment(const Point3& point, const Point3& from, const Point3& to) {
  const Vector along = between(from, to), there = between(from, point);
  const double length = dot(along, along);
  const double at = length > 0 ? std::clamp(dot(along, there) / length, 0.0, 1.0) : 0;
  const Vector rest{there[0] - at * along[0], there[1] - at * along[1], there[2] - at * along[2]};
  return dot(rest, rest);
}

/// From the line of a side to its facet's apex, at a right angle.
Vector inward(const Indexed& mesh, const OpenSide& side) {
  const Vector along = between(mesh.vertex[side.from], mesh.vertex[side.to]);
  Vector up = between(mesh.vertex[side.from], mesh.vertex[side.apex]);
  const double length = dot(along, along), share = length > 0 ? dot(along, up) / length : 0;
  for (std::size_t k = 0; k < 3; ++k) up[k] -= share * along[k];
  return up;
}

/// `from` ends of some open sides by the cell that they lie in.
class EndCells {
 public:
  /// reach  how far what is found may lie, nm
  EndCells(const Indexed& mesh, std::span<const OpenSide> open, Buffer<std::uint32_t> sides, std::int64_t reach)
      : size_(2 * std::max<std::int64_t>(reach, 1)) {
    std::size_t buckets = 1;
    while (buckets < sides.size()) buckets *= 2;
    mask_ = buckets - 1;
    first_.resize(buckets + 1);
    std::fill(first_.begin(), first_.end(), 0u);
    side_.resize(sides.size());
    Buffer<std::uint32_t> bucket(sides.size());
    for (std::size_t i = 0; i < sides.size(); ++i) {
      const Point3& p = mesh.vertex[open[sides[i]].from];
      bucket[i] = static_cast<std::uint32_t>(hash(cell(p.x), cell(p.y), cell(p.z)));
      ++first_[bucket[i] + 1];
    }
    for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
    Buffer<std::uint32_t> next = first_;
    for (std::size_t i = 0; i < sides.size(); ++i) side_[next[bucket[i]]++] = sides[i];
  }

  /// Calls visit(side) for all sides that may begin within `reach` of a point, and within that of the cells, each once, and for
  /// some others.
  template <class Visit>
  void near(const Point3& p, std::int64_t reach, const Visit& visit) const {
    const std::int64_t off = std::min(reach, size_ / 2);
    const auto ends = [&](std::int64_t x) { return std::array{cell(x - off), cell(x + off)}; };
    const std::array xs = ends(p.x), ys = ends(p.y), zs = ends(p.z);
    std::array<std::size_t, 8> visited{};
    std::size_t count = 0;
    for (std::int64_t x = xs[0]; x <= xs[1]; ++x) {
      for (std::int64_t y = ys[0]; y <= ys[1]; ++y) {
        for (std::int64_t z = zs[0]; z <= zs[1]; ++z) {
          const std::size_t bucket = hash(x, y, z);
          if (std::find(visited.begin(), visited.begin() + count, bucket) != visited.begin() + count) continue;
          visited[count++] = bucket;
          for (std::uint32_t i = first_[bucket]; i < first_[bucket + 1]; ++i) visit(side_[i]);
        }
      }
    }
  }

 private:
  std::int64_t cell(std::int64_t x) const { return floor_div<std::int64_t>(x, size_); }
  /// Cells of a block of 8 lie side by side, so that neighbours are looked up where the processor's cache has them.
  std::size_t hash(std::int64_t x, std::int64_t y, std::int64_t z) const {
    std::uint64_t h = static_cast<std::uint64_t>(x >> 1) * 0x9e3779b97f4a7c15 ^
                      static_cast<std::uint64_t>(y >> 1) * 0xc2b2ae3d27d4eb4f ^
                      static_cast<std::uint64_t>(z >> 1) * 0x165667b19e3779f9;
    h ^= h >> 29;
    const std::uint64_t block = h * 0xbf58476d1ce4e5b9 >> 32;
    const auto within = static_cast<std::uint64_t>((x & 1) | (y & 1) << 1 | (z & 1) << 2);
    return static_cast<std::size_t>(block << 3 | within) & mask_;
  }

  std::int64_t size_;
  std::size_t mask_ = 0;
  Buffer<std::uint32_t> first_, side_;
};

/// Open sides in cells as wide as their own edges let them be joined: what is found does not grow with the distance.
class Levels {
 public:
  Levels(const Indexed& mesh, std::span<const OpenSide> open, std::span<const float> shortest, std::int64_t distance)
      : mesh_(mesh), shortest_(shortest), distance_(distance) {
    std::array<Buffer<std::uint32_t>, kLevels> sides;
    for (std::uint32_t i = 0; i < open.size(); ++i) {
      std::size_t level = 0;
      while (level + 1 < kLevels && reach(open[i].from) <= distance >> (level + 1)) ++level;
      sides[level].push_back(i);
    }
    for (std::size_t level = 0; level < kLevels; ++level)
      if (!sides[level].empty()) cells_.emplace_back(mesh, open, std::move(sides[level]), distance >> level);
  }

  /// Calls visit(side) for all sides whose begin may be joined with a vertex, each once, and for some others.
  template <class Visit>
  void near(std::uint32_t vertex, const Visit& visit) const {
    for (const EndCells& cells : cells_) cells.near(mesh_.vertex[vertex], reach(vertex), visit);
  }

 private:
  static constexpr std::size_t kLevels = 8;
  /// Rounded up, nm.
  std::int64_t reach(std::uint32_t vertex) const {
    const double half = 0.5 * static_cast<double>(shortest_[vertex]);
    return half < static_cast<double>(distance_) ? static_cast<std::int64_t>(half) + 1 : distance_;
  }

  const Indexed& mesh_;
  std::span<const float> shortest_;
  std::int64_t distance_;
  std::vector<EndCells> cells_;
};

class MatchSearch {
 public:
  MatchSearch(const Indexed& mesh, std::span<const OpenSide> open, std::span<const float> shortest, std::int64_t distance)
      : mesh_(mesh), open_(open), shortest_(shortest), distance_(static_cast<double>(distance)) {}

  void from(std::uint32_t i, const Levels& levels, Buffer<Match>& found) const {
    const OpenSide& side = open_[i];
    levels.near(side.to, [&](std::uint32_t j) {
      if (i == j) return;
      const OpenSide& other = open_[j];
      const double here = joint(side.to, other.from), there = joint(side.from, other.to);
      if (here < 0 || upon_each_other(side, other)) return;
      if (there >= 0) {
        if (i < j) found.push_back({std::max(here, there), MatchKind::kOpposite, i, j});
      } else if (runs_back(side, other)) {
        found.push_back({here, MatchKind::kAlong, i, j});
      }
    });
    levels.near(side.from, [&](std::uint32_t j) {
      if (i >= j) return;
      const OpenSide& other = open_[j];
      const double here = joint(side.from, other.from), there = joint(side.to, other.to);
      if (here < 0 || there < 0 || upon_each_other(side, other)) return;
      found.push_back({std::max(here, there), MatchKind::kEqual, i, j});
    });
  }

 private:
  /// Square of the distance between two vertices that may become one; -1 if they may not.
  double joint(std::uint32_t one, std::uint32_t other) const {
    if (one == other) return 0;
    const double square = squared(mesh_.vertex[one], mesh_.vertex[other]);
    const double maximum = std::min(distance_, 0.5 * static_cast<double>(std::min(shortest_[one], shortest_[other])));
    return square <= maximum * maximum ? square : -1;
  }

  /// The shorter one ends on the longer one.
  bool runs_back(const OpenSide& side, const OpenSide& other) const {
    const auto& at = mesh_.vertex;
    const double own = squared(at[side.from], at[side.to]), its = squared(at[other.from], at[other.to]);
    const double off = own < its ? squared_to_segment(at[side.from], at[other.from], at[other.to])
                                 : squared_to_segment(at[other.to], at[side.from], at[side.to]);
    return off <= distance_ * distance_ && dot(between(at[side.from], at[side.to]), between(at[other.from], at[other.to])) < 0;
  }

  /// Both facets rise from their common edge to the same side, within some 37 degrees, and are large enough to tell.
  bool upon_each_other(const OpenSide& side, const OpenSide& other) const {
    const Vector u = inward(mesh_, side), v = inward(mesh_, other);
    const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), enough = 16 * distance_ * distance_;
    return uv > 0 && uu > enough && vv > enough && uv * uv > 0.64 * uu * vv;
  }

  const Indexed& mesh_;
  std::span<const OpenSide> open_;
  std::span<const float> shortest_;
  double distance_;
};

}  // namespace

Buffer<OpenSide> open_sides(const Indexed& mesh, std::span<const Side> sides) {
  Buffer<OpenSide> open;
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    if (end - begin != 1) return;
    const Indexed::Facet& facet = mesh.facet[begin->facet];
    std::uint32_t apex = facet[0];
    for (const std::uint32_t corner : facet)
      if (corner != begin->low && corner != begin->high) apex = corner;
    open.push_back(begin->forward ? OpenSide{begin->low, begin->high, apex} : OpenSide{begin->high, begin->low, apex});
  });
  return open;
}

Buffer<Match> find_matches(const Indexed& mesh, std::span<const OpenSide> open, std::span<const float> shortest,
                           std::int64_t distance_nm) {
  const Levels levels(mesh, open, shortest, distance_nm);
  const MatchSearch search(mesh, open, shortest, distance_nm);
  tbb::enumerable_thread_specific<Buffer<Match>> found;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, open.size(), 1024), [&](const auto& range) {
    Buffer<Match>& own = found.local();
    for (std::size_t i = range.begin(); i != range.end(); ++i) search.from(static_cast<std::uint32_t>(i), levels, own);
  });
  Buffer<Match> all;
  for (const Buffer<Match>& own : found) all.insert(all.end(), own.begin(), own.end());
  tbb::parallel_sort(all.begin(), all.end(), [](const Match& one, const Match& other) {
    return std::tie(one.kind, one.cost, one.first, one.second) < std::tie(other.kind, other.cost, other.first, other.second);
  });
  return all;
}

}  // namespace lamina::load
