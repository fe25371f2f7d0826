#include "stages/slice/loops.h"

#include <bit>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "stages/data/growth.h"

namespace lamina::slice {
namespace {

std::uint64_t hash_of(const Point3& p) {
  const auto word = [](Nm v) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(v)); };
  std::uint64_t h = (word(p.x) | word(p.y) << 32) * 0x9E3779B97F4A7C15ull;
  h ^= h >> 29;
  return (h + word(p.z)) * 0xBF58476D1CE4E5B9ull;
}

std::uint32_t hash_of(std::uint64_t low, std::uint64_t high) {
  const std::uint64_t h = (low ^ (high >> 31) ^ (high << 33)) * 0x94D049BB133111EBull;
  return static_cast<std::uint32_t>(h ^ (h >> 32));
}

/// from + the share num / den of the way to `to`, rounded; 0 <= num < den.
Nm exact_between(Nm from, Nm to, std::int64_t num, std::int64_t den) {
  const __int128 way = static_cast<__int128>(std::int64_t{to} - from) * num * 2 + den;
  return static_cast<Nm>(from + static_cast<std::int64_t>(floor_div<__int128>(way, static_cast<__int128>(den) * 2)));
}

/// The product of two doubles that are each off by at most 2^-53 of themselves, for ways below 2^31, then one addition: off by
/// less than 2^-19. Values near a half are decided in integers.
Nm between(Nm from, Nm to, double share, std::int64_t num, std::int64_t den) {
  constexpr double kNear = 0x1p-17, kPositive = 0x1p32;
  const double way = share * static_cast<double>(std::int64_t{to} - from) + 0.5 + kPositive;
  const auto whole = static_cast<std::int64_t>(way);
  const double rest = way - static_cast<double>(whole);
  if (rest < kNear || rest > 1 - kNear) [[unlikely]]
    return exact_between(from, to, num, den);
  return static_cast<Nm>(from + whole - static_cast<std::int64_t>(kPositive));
}

/// The corners of a facet, the first alone on its side of the plane; the plane cuts the two edges that start there.
struct Tip {
  Point3 own, next, previous;
  bool above;

  Tip(const Triangle& t, std::int64_t z) {
    const Point3* corner = &t.a;
    const bool a = is_above_plane(t.a.z, z), b = is_above_plane(t.b.z, z), c = is_above_plane(t.c.z, z);
    const std::uint32_t tip = a == b ? 2 : a == c ? 1 : 0;
    own = corner[tip], next = corner[tip == 2 ? 0 : tip + 1], previous = corner[tip == 0 ? 2 : tip - 1];
    above = is_above_plane(own.z, z);
  }
  Edge from() const { return above ? Edge{next, own} : Edge{own, previous}; }
  Edge to() const { return above ? Edge{previous, own} : Edge{own, next}; }
};

[[gnu::cold]] void add_level(const Point3* corner, LevelFace& level) {
  const std::int64_t ux = std::int64_t{corner[1].x} - corner[0].x, uy = std::int64_t{corner[1].y} - corner[0].y;
  const std::int64_t vx = std::int64_t{corner[2].x} - corner[0].x, vy = std::int64_t{corner[2].y} - corner[0].y;
  level.add(static_cast<std::uint64_t>(std::abs(ux * vy - uy * vx)));
}

}  // namespace

Point2 crossing(const Edge& edge, std::int64_t z) {
  const Nm low_z = height_for_plane(edge.low.z, z);
  const std::int64_t num = z - low_z, den = std::int64_t{edge.high.z} - low_z;
  const double share = static_cast<double>(num) / static_cast<double>(den);
  return {between(edge.low.x, edge.high.x, share, num, den), between(edge.low.y, edge.high.y, share, num, den)};
}

namespace {

void resize(Cuts& cuts, std::size_t count) {
  ensure_capacity(cuts.from_hash, count);
  ensure_capacity(cuts.to_hash, count);
  ensure_capacity(cuts.at, count);
  cuts.from_hash.resize(count);
  cuts.to_hash.resize(count);
  cuts.at.resize(count);
  cuts.order.clear();
  cuts.level = {};
}

void cut_facet(const Triangle& t, std::int64_t z, std::size_t i, Cuts& cuts) {
  const Tip tip(t, z);
  const std::uint64_t own = hash_of(tip.own), next = hash_of(tip.next), previous = hash_of(tip.previous);
  cuts.from_hash[i] = tip.above ? hash_of(next, own) : hash_of(own, previous);
  cuts.to_hash[i] = tip.above ? hash_of(previous, own) : hash_of(own, next);
  cuts.at[i] = crossing(tip.from(), z);
  if (LevelFace::is_level(t.a.z - z, t.b.z - z, t.c.z - z)) [[unlikely]]
    add_level(&t.a, cuts.level);
}

}  // namespace

void cut(std::span<const Triangle> list, std::span<const std::uint32_t> at, std::int64_t z, Cuts& cuts) {
  const std::size_t count = at.size();
  resize(cuts, count);
  constexpr std::size_t kAhead = 16;  // facets of a list are anywhere in memory: prefetched before they are needed
  for (std::size_t i = 0; i < count; ++i) {
    if (i + kAhead < count) {
      const auto* next = reinterpret_cast<const char*>(&list[at[i + kAhead]]);
      __builtin_prefetch(next);
      __builtin_prefetch(next + sizeof(Triangle) - 1);
    }
    cut_facet(list[at[i]], z, i, cuts);
  }
}

void cut(const BlockPlanes& planes, std::uint32_t plane, std::int64_t z, BlockScratch& scratch, Buffer<std::uint32_t>& facets,
         Cuts& cuts) {
  resize(cuts, planes.count(plane));
  std::size_t i = 0;
  planes.find(plane, scratch, facets, cuts.order, [&](std::span<const Triangle> crossed) {
    for (const Triangle& t : crossed) cut_facet(t, z, i++, cuts);
  });
}

PlaneIndex index_crossings(std::span<const Triangle> triangles, std::span<const std::int64_t> planes) {
  const PlaneFinder first_at_or_above(planes);
  return {0, static_cast<std::int64_t>(planes.size()) - 1, 0, [&](auto use) {
            for (std::uint32_t facet = 0; facet < triangles.size(); ++facet) {
              const Triangle& t = triangles[facet];
              const auto [low, high] = std::minmax({t.a.z, t.b.z, t.c.z});
              const auto [first, last] = first_at_or_above.crossed(low, high);
              if (first < last) use({first, last, facet});
            }
          }};
}

namespace {

constexpr std::uint32_t kNone = UINT32_MAX;
constexpr std::uint32_t kTaken = UINT32_MAX;  // of a slot: passed over, but the search continues after it
constexpr std::uint8_t kHasPrevious = 1, kVisited = 2, kSharesHash = 4;

/// For each cut the one that starts at the edge where it ends. Where several start there, at an edge of four or more
/// facets, the first that is free. On a closed mesh as many cuts start at edges of one hash as end at them: where only one
/// starts, both are at the same edge.
void find_successors(const CrossedFacets& facets, const Cuts& cuts, std::int64_t z, ChainScratch& scratch) {
  const std::size_t count = cuts.size(), slots = count + count / 2 + 2;
  ensure_capacity(scratch.slot, slots);
  ensure_capacity(scratch.next, count);
  scratch.slot.assign(slots, 0);
  scratch.next.resize(count);
  scratch.state.assign(count, 0);
  const auto first_slot = [&](std::uint32_t hash) { return static_cast<std::size_t>(hash * std::uint64_t{slots} >> 32); };
  const auto behind = [&](std::size_t position) { return position + 1 == slots ? 0 : position + 1; };
  for (std::uint32_t n = 0; n < count; ++n) {
    const std::uint32_t i = cuts.nth(n), hash = cuts.from_hash[i];
    std::size_t position = first_slot(hash);
    for (; scratch.slot[position] != 0; position = behind(position)) {
      const std::uint32_t other = scratch.slot[position] - 1;
      if (cuts.from_hash[other] == hash) scratch.state[i] = scratch.state[other] = kSharesHash;
    }
    scratch.slot[position] = i + 1;
  }
  for (std::uint32_t n = 0; n < count; ++n) {
    const std::uint32_t i = cuts.nth(n), hash = cuts.to_hash[i];
    std::uint32_t found = kNone;
    for (std::size_t position = first_slot(hash); scratch.slot[position] != 0; position = behind(position)) {
      if (scratch.slot[position] == kTaken) continue;
      const std::uint32_t other = scratch.slot[position] - 1;
      if (cuts.from_hash[other] != hash) continue;
      const bool decided = facets.closed && (scratch.state[other] & kSharesHash) == 0;
      if (!decided && !(Tip(facets[other], z).from() == Tip(facets[i], z).to())) continue;
      scratch.slot[position] = kTaken;
      scratch.state[other] |= kHasPrevious;
      found = other;
      break;
    }
    scratch.next[i] = found;
  }
}

}  // namespace

void chain(const CrossedFacets& facets, const Cuts& cuts, std::int64_t z, ChainScratch& scratch, Contours& closed,
           Contours& open) {
  find_successors(facets, cuts, z, scratch);
  reserve_more(closed.point, cuts.size());
  const auto count = static_cast<std::uint32_t>(cuts.size());
  for (std::uint32_t n = 0; n < count; ++n) {
    const std::uint32_t first = cuts.nth(n);
    if ((scratch.state[first] & kHasPrevious) != 0) continue;
    std::uint32_t last = first;
    for (std::uint32_t i = first; i != kNone; i = scratch.next[i]) {
      open.point.push_back(cuts.at[i]);
      scratch.state[i] |= kVisited;
      last = i;
    }
    open.point.push_back(crossing(Tip(facets[last], z).to(), z));
    open.close();
  }
  for (std::uint32_t n = 0; n < count; ++n) {
    const std::uint32_t first = cuts.nth(n);
    if ((scratch.state[first] & kVisited) != 0) continue;
    std::uint32_t i = first;
    do {
      closed.point.push_back(cuts.at[i]);
      scratch.state[i] |= kVisited;
      i = scratch.next[i];
    } while (i != first);
    closed.close();
  }
}

namespace {

struct Bridge {
  __int128 squared;  // nm^2
  std::uint32_t from, to;
};

/// All bridges that are short enough, shortest first.
std::vector<Bridge> find_bridges(const Contours& open, Nm maximum) {
  const std::uint32_t count = open.size();
  std::vector<std::uint32_t> by_x(count);  // chains by the x of their start
  std::iota(by_x.begin(), by_x.end(), 0u);
  const auto start_x = [&](std::uint32_t chain) { return open[chain].front().x; };
  std::ranges::sort(by_x, {}, [&](std::uint32_t chain) { return std::pair(start_x(chain), chain); });
  std::vector<Bridge> bridges;
  for (std::uint32_t from = 0; from < count; ++from) {
    const Point2 end = open[from].back();
    const auto first = std::ranges::lower_bound(by_x, std::int64_t{end.x} - maximum, {},
                                                [&](std::uint32_t chain) { return std::int64_t{start_x(chain)}; });
    for (auto it = first; it != by_x.end() && start_x(*it) <= std::int64_t{end.x} + maximum; ++it) {
      const Point2 start = open[*it].front();
      const std::int64_t dx = std::int64_t{start.x} - end.x, dy = std::int64_t{start.y} - end.y;
      const __int128 squared = static_cast<__int128>(dx) * dx + static_cast<__int128>(dy) * dy;
      if (squared <= static_cast<__int128>(maximum) * maximum) bridges.push_back({squared, from, *it});
    }
  }
  std::ranges::sort(bridges, [](const Bridge& a, const Bridge& b) {
    return std::tie(a.squared, a.from, a.to) < std::tie(b.squared, b.from, b.to);
  });
  return bridges;
}

}  // namespace

GapReport close_gaps(Contours& open, Nm maximum, Contours& closed) {
  GapReport report;
  const std::uint32_t count = open.size();
  if (count == 0) return report;
  std::vector<std::uint32_t> next(count, kNone), previous(count, kNone);
  for (const Bridge& bridge : find_bridges(open, maximum)) {
    if (next[bridge.from] != kNone || previous[bridge.to] != kNone) continue;
    next[bridge.from] = bridge.to;
    previous[bridge.to] = bridge.from;
    ++report.closed;
    const auto length = static_cast<std::int64_t>(std::ceil(std::sqrt(static_cast<double>(bridge.squared))));
    report.largest_closed = std::max(report.largest_closed, length);
  }
  Contours rest;
  std::vector<std::uint8_t> done(count, 0);
  const auto walk = [&](std::uint32_t first, Contours& out) {
    for (std::uint32_t chain = first; chain != kNone && done[chain] == 0; chain = next[chain]) {
      done[chain] = 1;
      const auto points = open[chain];
      out.point.insert(out.point.end(), points.begin(), points.end());
    }
    out.close();
  };
  for (std::uint32_t chain = 0; chain < count; ++chain)
    if (previous[chain] == kNone) walk(chain, rest);
  for (std::uint32_t chain = 0; chain < count; ++chain)
    if (done[chain] == 0) walk(chain, closed);
  report.open = rest.size();
  if (rest.size() > 0) report.first_open = rest[0].front();
  open = std::move(rest);
  return report;
}

std::vector<SourceMesh> find_sources(std::span<const Mesh> meshes, std::span<const Instance> instances,
                                     std::span<const Nm> planes, std::vector<std::uint32_t>& source_of) {
  std::map<std::pair<std::uint32_t, Nm>, std::uint32_t> known;
  std::vector<std::int64_t> own_planes(planes.size());
  std::vector<SourceMesh> sources;
  for (const Instance& instance : instances) {
    const Nm z = instance.offset.z;
    const auto [found, is_new] = known.emplace(std::pair(instance.mesh, z), static_cast<std::uint32_t>(sources.size()));
    if (is_new) {
      std::ranges::transform(planes, own_planes.begin(), [&](Nm plane) { return std::int64_t{plane} - z; });
      const Mesh& mesh = meshes[instance.mesh];
      SourceMesh& source = sources.emplace_back(SourceMesh{instance.mesh, z, nullptr, nullptr});
      if (mesh.blocks)
        source.blocks = std::make_shared<const BlockPlanes>(*mesh.blocks, own_planes);
      else
        source.list = std::make_shared<const PlaneIndex>(index_crossings(mesh.triangles, own_planes));
    }
    source_of.push_back(found->second);
  }
  return sources;
}

void append_moved(const Contours& from, Point2 by, Contours& to) {
  const std::size_t before = to.point.size();
  reserve_more(to.point, from.point.size());
  to.point.resize(before + from.point.size());
  std::ranges::transform(from.point, to.point.begin() + static_cast<std::ptrdiff_t>(before), [by](Point2 p) {
    return Point2{p.x + by.x, p.y + by.y};
  });
  for (std::uint32_t c = 1; c <= from.size(); ++c) to.offset.push_back(static_cast<std::uint32_t>(before) + from.offset[c]);
}

}  // namespace lamina::slice
