// stages/load/repair/weld.cpp: open edges joined, nearest first, over one distance after the other.
#include "stages/load/repair/weld.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "stages/load/repair/matches.h"

namespace lamina::load {
namespace {

/// Vertices in clusters that become one vertex each.
class Clusters {
 public:
  explicit Clusters(const Indexed& mesh) : facets_(mesh.facet), sets_(mesh.vertex.size()), next_(mesh.vertex.size()) {
    const std::size_t count = mesh.vertex.size();
    std::iota(next_.begin(), next_.end(), 0u);
    members_.resize(count);
    std::fill(members_.begin(), members_.end(), 1u);
    sum_.resize(count);
    box_.resize(count);
    for (std::size_t v = 0; v < count; ++v) {
      const Point3& p = mesh.vertex[v];
      sum_[v] = {p.x, p.y, p.z};
      box_[v] = {};
      box_[v].add(p);
    }
    // Which facets use a vertex, in one list.
    first_.resize(count + 1);
    std::fill(first_.begin(), first_.end(), 0u);
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
  Buffer<float> shortest(mesh.vertex.size());
  std::fill(shortest.begin(), shortest.end(), 1e30f);
  for (const Indexed::Facet& facet : mesh.facet) {
    if (collapsed(facet)) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t one = facet[k], other = facet[(k + 1) % 3];
      const Point3 &p = mesh.vertex[one], &q = mesh.vertex[other];
      const double x = static_cast<double>(p.x) - q.x, y = static_cast<double>(p.y) - q.y, z = static_cast<double>(p.z) - q.z;
      const auto length = static_cast<float>(std::sqrt(x * x + y * y + z * z));
      shortest[one] = std::min(shortest[one], length);
      shortest[other] = std::min(shortest[other], length);
    }
  }
  return shortest;
}

void join_matches(std::span<const OpenSide> open, std::span<const Match> matches, std::int64_t distance, Clusters& clusters) {
  Buffer<std::uint8_t> from_used(open.size()), to_used(open.size());
  std::fill(from_used.begin(), from_used.end(), std::uint8_t{0});
  std::fill(to_used.begin(), to_used.end(), std::uint8_t{0});
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
