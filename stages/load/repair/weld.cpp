// stages/load/repair/weld.cpp: which open edges could be one edge, found from their ends in cells of space; these are joined,
// nearest first, over one distance after the other.
#include "stages/load/repair/weld.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/load/transform.h"

namespace lamina::load {
namespace {

/// A facet's side that no other facet shares.
struct OpenSide {
  std::uint32_t from, to, apex;  // vertices; the apex is the facet's third
};

enum class MatchKind : std::uint8_t {
  kOpposite,  // one runs from `to` to `from` of the other
  kAlong,     // `to` of the first is at `from` of the second, which runs back along it
  kEqual      // both run the same way: one of the facets is turned over
};

struct Match {
  double cost;  // square of the larger distance between ends, nm2
  MatchKind kind;
  std::uint32_t first, second;  // indices of open sides; first < second unless kAlong
};

Vector between(const Point3& from, const Point3& to) {
  return {static_cast<double>(to.x) - from.x, static_cast<double>(to.y) - from.y, static_cast<double>(to.z) - from.z};
}
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
    first_.assign(buckets + 1, 0u);
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
  /// Cells of a block of 8 are adjacent, so that neighbours are found where the processor's cache has them.
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

class MatchSearch {
 public:
  MatchSearch(const Indexed& mesh, std::span<const OpenSide> open, std::span<const float> shortest, std::int64_t distance)
      : mesh_(mesh), open_(open), shortest_(shortest), distance_nm_(distance), distance_(static_cast<double>(distance)) {
    std::array<Buffer<std::uint32_t>, kLevels> sides;
    for (std::uint32_t i = 0; i < open.size(); ++i) {
      std::size_t level = 0;
      while (level + 1 < kLevels && reach(open[i].from) <= distance >> (level + 1)) ++level;
      sides[level].push_back(i);
    }
    for (std::size_t level = 0; level < kLevels; ++level)
      if (!sides[level].empty()) cells_.emplace_back(mesh, open, std::move(sides[level]), distance >> level);
  }

  void from(std::uint32_t i, Buffer<Match>& found) const {
    const OpenSide& side = open_[i];
    near(side.to, [&](std::uint32_t j) {
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
    near(side.from, [&](std::uint32_t j) {
      if (i >= j) return;
      const OpenSide& other = open_[j];
      const double here = joint(side.from, other.from), there = joint(side.to, other.to);
      if (here < 0 || there < 0 || upon_each_other(side, other)) return;
      found.push_back({std::max(here, there), MatchKind::kEqual, i, j});
    });
  }

 private:
  static constexpr std::size_t kLevels = 8;
  /// Rounded up, nm.
  std::int64_t reach(std::uint32_t vertex) const {
    const double half = 0.5 * static_cast<double>(shortest_[vertex]);
    return half < distance_ ? static_cast<std::int64_t>(half) + 1 : distance_nm_;
  }

  /// Calls visit(side) for all sides whose begin may be joined with a vertex, each once, and for some others.
  template <class Visit>
  void near(std::uint32_t vertex, const Visit& visit) const {
    for (const EndCells& cells : cells_) cells.near(mesh_.vertex[vertex], reach(vertex), visit);
  }

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

  /// Both facets rise from their common edge to the same side, within some 37 degrees, and are large enough to decide.
  bool upon_each_other(const OpenSide& side, const OpenSide& other) const {
    const Vector u = inward(mesh_, side), v = inward(mesh_, other);
    const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), enough = 16 * distance_ * distance_;
    return uv > 0 && uu > enough && vv > enough && uv * uv > 0.64 * uu * vv;
  }

  const Indexed& mesh_;
  std::span<const OpenSide> open_;
  std::span<const float> shortest_;
  std::int64_t distance_nm_;
  double distance_;
  /// As wide as the own edges of sides let them be joined: what is found does not grow with the distance.
  std::vector<EndCells> cells_;
};

/// Open sides in the order of `sides`.
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

/// All pairs within the distance whose ends are no further apart than half of the shortest edge there, and whose facets
/// do not lie upon each other. Sorted: kind, cost, sides.
/// shortest  for each vertex the length of the shortest edge at it, nm
/// cost      O(E log E) for E open sides, parallel; the same for any number of threads
Buffer<Match> find_matches(const Indexed& mesh, std::span<const OpenSide> open, std::span<const float> shortest,
                           std::int64_t distance_nm) {
  const MatchSearch search(mesh, open, shortest, distance_nm);
  tbb::enumerable_thread_specific<Buffer<Match>> found;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, open.size(), 1024), [&](const auto& range) {
    Buffer<Match>& own = found.local();
    for (std::size_t i = range.begin(); i != range.end(); ++i) search.from(static_cast<std::uint32_t>(i), own);
  });
  Buffer<Match> all;
  for (const Buffer<Match>& own : found) all.insert(all.end(), own.begin(), own.end());
  tbb::parallel_sort(all.begin(), all.end(), [](const Match& one, const Match& other) {
    return std::tie(one.kind, one.cost, one.first, one.second) < std::tie(other.kind, other.cost, other.first, other.second);
  });
  return all;
}

/// Vertices in clusters that become one vertex each.
class Clusters {
 public:
  explicit Clusters(const Indexed& mesh) : facets_(mesh.facet), sets_(mesh.vertex.size()), next_(mesh.vertex.size()) {
    const std::size_t count = mesh.vertex.size();
    std::iota(next_.begin(), next_.end(), 0u);
    members_.assign(count, 1u);
    sum_.resize(count);
    box_.resize(count);
    for (std::size_t v = 0; v < count; ++v) {
      const Point3& p = mesh.vertex[v];
      sum_[v] = {p.x, p.y, p.z};
      box_[v] = {};
      box_[v].add(p);
    }
    // Which facets use a vertex, in one list.
    first_.assign(count + 1, 0u);
    for (const Indexed::Facet& facet : facets_)
      for (const std::uint32_t corner : facet) ++first_[corner + 1];
    for (std::size_t v = 0; v < count; ++v) first_[v + 1] += first_[v];
    user_.resize(3 * facets_.size());
    Buffer<std::uint32_t> free = first_;
    for (std::uint32_t f = 0; f < facets_.size(); ++f)
      for (const std::uint32_t corner : facets_[f]) user_[free[corner]++] = f;
  }

  std::uint32_t find(std::uint32_t vertex) { return sets_.find(vertex); }
  std::uint64_t joined() const { return joined_; }

  /// Whether two vertices may become one: no facet has both, and together they spread no wider than the distance.
  bool may_join(std::uint32_t one, std::uint32_t other, std::int64_t distance) {
    one = find(one), other = find(other);
    if (one == other) return true;
    Box both = box_[one];
    both.add(box_[other]);
    if (std::max({both.width(), both.depth(), both.height()}) > distance) return false;
    if (members_[one] > members_[other]) std::swap(one, other);
    std::uint32_t member = one;
    do {
      for (std::uint32_t i = first_[member]; i < first_[member + 1]; ++i)
        for (const std::uint32_t corner : facets_[user_[i]])
          if (find(corner) == other) return false;
      member = next_[member];
    } while (member != one);
    return true;
  }

  void join(std::uint32_t one, std::uint32_t other) {
    one = find(one), other = find(other);
    if (one == other) return;
    sets_.join(one, other);
    const std::uint32_t kept = std::min(one, other), gone = std::max(one, other);
    members_[kept] += members_[gone];
    box_[kept].add(box_[gone]);
    for (std::size_t k = 0; k < 3; ++k) sum_[kept][k] += sum_[gone][k];
    std::swap(next_[kept], next_[gone]);  // two rings become one
    ++joined_;
  }

  /// The middle of a cluster's vertices, rounded down.
  Point3 position(std::uint32_t representative) const {
    const auto mean = [&](std::size_t k) {
      return static_cast<Nm>(floor_div<std::int64_t>(sum_[representative][k], members_[representative]));
    };
    return {mean(0), mean(1), mean(2)};
  }

 private:
  std::span<const Indexed::Facet> facets_;
  DisjointSets sets_;
  Buffer<std::uint32_t> next_, members_, first_, user_;
  Buffer<std::array<std::int64_t, 3>> sum_;
  Buffer<Box> box_;
  std::uint64_t joined_ = 0;
};

Buffer<float> shortest_edges(const Indexed& mesh) {
  Buffer<float> shortest(mesh.vertex.size(), 1e30f);
  for (const Indexed::Facet& facet : mesh.facet) {
    if (collapsed(facet)) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t one = facet[k], other = facet[(k + 1) % 3];
      const auto length = static_cast<float>(std::sqrt(squared(mesh.vertex[one], mesh.vertex[other])));
      shortest[one] = std::min(shortest[one], length);
      shortest[other] = std::min(shortest[other], length);
    }
  }
  return shortest;
}

void join_matches(std::span<const OpenSide> open, std::span<const Match> matches, std::int64_t distance, Clusters& clusters) {
  Buffer<std::uint8_t> from_used(open.size(), 0), to_used(open.size(), 0);
  for (const Match& match : matches) {
    const OpenSide &one = open[match.first], &other = open[match.second];
    const bool along = match.kind == MatchKind::kAlong, equal = match.kind == MatchKind::kEqual;
    if (to_used[match.first] || from_used[match.second]) continue;
    if (!along && (from_used[match.first] || to_used[match.second])) continue;
    const std::uint32_t partner_of_to = equal ? other.to : other.from, partner_of_from = equal ? other.from : other.to;
    if (!clusters.may_join(one.to, partner_of_to, distance)) continue;
    if (!along && !clusters.may_join(one.from, partner_of_from, distance)) continue;
    clusters.join(one.to, partner_of_to);
    to_used[match.first] = from_used[match.second] = 1;
    if (along) continue;
    // The first joint may have changed what the second may do.
    if (!clusters.may_join(one.from, partner_of_from, distance)) continue;
    clusters.join(one.from, partner_of_from);
    from_used[match.first] = to_used[match.second] = 1;
  }
}

struct Faults {
  std::uint64_t open = 0, crowded = 0;  // edges with one facet, with more than two
};

Faults faults(std::span<const Side> sides) {
  Faults found;
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    found.open += end - begin == 1;
    found.crowded += end - begin > 2;
  });
  return found;
}

}  // namespace

std::int64_t farthest_weld(const Indexed& mesh) {
  float farthest = 0;
  for (const float length : shortest_edges(mesh))
    if (length < 1e30f) farthest = std::max(farthest, length);
  return static_cast<std::int64_t>(std::ceil(farthest / 2)) + 1;
}

Welding weld(Indexed& mesh, Buffer<Side>& sides, const WeldRange& range) {
  Welding welding;
  Faults now = faults(sides);
  Buffer<float> shortest = now.open > 0 ? shortest_edges(mesh) : Buffer<float>();
  std::int64_t distance = range.start_nm;
  /// returns  whether a larger distance may close more
  const auto join_within = [&] {
    const Buffer<OpenSide> open = open_sides(mesh, sides);
    const Buffer<Match> matches = find_matches(mesh, open, shortest, distance);
    if (matches.empty()) return true;
    Clusters clusters(mesh);
    join_matches(open, matches, distance, clusters);
    if (clusters.joined() == 0) return true;
    Buffer<Indexed::Facet> facets = mesh.facet;
    for (Indexed::Facet& facet : facets)
      for (std::uint32_t& corner : facet) corner = clusters.find(corner);
    Buffer<Side> joined = sorted_sides(facets);
    const Faults then = faults(joined);
    if (then.crowded > now.crowded && 8 * (then.crowded - now.crowded) > now.open - std::min(now.open, then.open)) return false;
    if (then.open >= now.open) return true;
    for (std::uint32_t v = 0; v < mesh.vertex.size(); ++v)
      if (clusters.find(v) == v) mesh.vertex[v] = clusters.position(v);
    mesh.facet = std::move(facets);
    sides = std::move(joined);
    now = then;
    shortest = shortest_edges(mesh);
    welding.joined += clusters.joined();
    welding.distance_nm = distance;
    return true;
  };
  while (distance > 0 && now.open > 0 && join_within() && distance < range.max_nm)
    distance = std::min(2 * distance, range.max_nm);
  return welding;
}

}  // namespace lamina::load
