#include "stages/coverage/meet/meetings.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdlib>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "stages/coverage/meet/facet_group.h"
#include "stages/geometry/isa.h"

namespace lamina::coverage {
namespace {

// --- facets of a mesh in groups that lie near each other, and which groups touch a box.

constexpr std::uint64_t kNoFacet = UINT64_MAX;
constexpr int kKeyBits = 32, kMaxBits = 16;  // of a position along the curve; of one axis

/// Where points of a box come along the curve.
class Curve {
 public:
  explicit Curve(const Box& box) : low_{box.lo.x, box.lo.y, box.lo.z} {
    const std::array<std::int64_t, 3> side{box.width() + 1, box.depth() + 1, box.height() + 1};
    std::array<int, 3> bits{};
    std::array<int, kKeyBits> axis_of{};  // from the highest bit of a key on
    int used = 0;
    for (; used < kKeyBits; ++used) {
      int widest = -1;
      for (int axis = 0; axis < 3; ++axis) {
        if (bits[axis] == kMaxBits) continue;
        if (widest < 0 || (side[axis] >> bits[axis]) > (side[widest] >> bits[widest])) widest = axis;
      }
      axis_of[used] = widest;
      ++bits[widest];
    }
    for (int axis = 0; axis < 3; ++axis) {
      cells_[axis] = static_cast<double>((std::int64_t{1} << bits[axis])) / static_cast<double>(side[axis]);
      std::array<std::uint32_t, kMaxBits> position{};  // of each bit of the axis, from its highest on
      int next = 0;
      for (int k = 0; k < used; ++k) {
        if (axis_of[k] == axis) position[next++] = 1u << (kKeyBits - 1 - k);
      }
      for (std::uint32_t byte = 0; byte < 256; ++byte) {
        for (int bit = 0; bit < 8; ++bit) {
          if ((byte >> bit & 1) == 0) continue;
          if (bit < bits[axis]) spread_[axis][0][byte] |= position[bits[axis] - 1 - bit];
          if (bit + 8 < bits[axis]) spread_[axis][1][byte] |= position[bits[axis] - 1 - bit - 8];
        }
      }
    }
  }

  std::uint32_t key(const Triangle& t) const {
    return part(0, t.a.x, t.b.x, t.c.x) | part(1, t.a.y, t.b.y, t.c.y) | part(2, t.a.z, t.b.z, t.c.z);
  }

 private:
  /// The cell of the middle between the lowest and the highest.
  std::uint32_t part(int axis, Nm a, Nm b, Nm c) const {
    const std::int64_t low = std::min(a, std::min(b, c)), high = std::max(a, std::max(b, c));
    const auto cell = static_cast<std::uint32_t>(static_cast<double>((low + high) / 2 - low_[axis]) * cells_[axis]);
    return spread_[axis][0][cell & 255] | spread_[axis][1][cell >> 8 & 255];
  }

  std::array<std::int64_t, 3> low_;
  std::array<double, 3> cells_{};
  std::array<std::array<std::array<std::uint32_t, 256>, 2>, 3> spread_{};
};

/// By the upper half, stably; entries without a facet are left out.
void sort_entries(Buffer<std::uint64_t>& entry) {
  constexpr int kDigit = 11, kPasses = 3;
  constexpr std::uint32_t kValues = 1u << kDigit;
  std::erase(entry, kNoFacet);
  Buffer<std::uint64_t> other;
  other.resize(entry.size());
  std::vector<std::uint32_t> position(std::size_t{kPasses} * kValues);
  const auto digit = [](std::uint64_t of, int pass) { return of >> (32 + kDigit * pass) & (kValues - 1); };
  for (const std::uint64_t of : entry) {
    for (int pass = 0; pass < kPasses; ++pass) ++position[pass * kValues + digit(of, pass)];
  }
  for (int pass = 0; pass < kPasses; ++pass) {
    std::uint32_t* const next = position.data() + pass * kValues;
    std::uint32_t total = 0;
    for (std::uint32_t value = 0; value < kValues; ++value) total += std::exchange(next[value], total);
    for (const std::uint64_t of : entry) other[next[digit(of, pass)]++] = of;
    std::swap(entry, other);
  }
}

Triangle facet_of(const MeshBlocks& mesh, std::uint32_t number) {
  return mesh.triangle(number / kClusterSize, number % kClusterSize);
}

/// Facets with area along a curve through their middles, sixteen a group, regardless of the file's order; and a tree of sixteen
/// boxes a node over the groups. 4 bytes a facet and 2 of boxes, 20 more while it is made.
///
/// Source: G. Morton's order (1966); each bit of it halves the cell's longest side
class FacetOrder {
 public:
  /// cost  O(T), parallel but for the sort
  FacetOrder(const MeshBlocks& mesh, const PairKernels& kernels) : kernels_(kernels) {
    sort(mesh);
    bound(mesh);
  }

  std::uint32_t groups() const { return static_cast<std::uint32_t>((facet_.size() + kGroupSize - 1) / kGroupSize); }
  /// Facets of a group, numbered cluster * kClusterSize + lane.
  std::span<const std::uint32_t> facets(std::uint32_t group) const {
    const std::size_t first = std::size_t{group} * kGroupSize;
    return {facet_.data() + first, std::min<std::size_t>(kGroupSize, facet_.size() - first)};
  }
  const Box& box(std::uint32_t group) const { return box_[group]; }

  /// Calls `see` with each group whose box touches the box, in rising order.
  template <class See>
  void each(const Box& box, See&& see) const {
    if (!levels_.empty()) visit(levels_.size() - 1, 0, box, see);
  }

 private:
  template <class See>
  void visit(std::size_t level, std::uint32_t node, const Box& box, See&& see) const {
    for (std::uint32_t touch = kernels_.touching(levels_[level][node], box); touch != 0; touch &= touch - 1) {
      const std::uint32_t child = node * kGroupSize + static_cast<std::uint32_t>(std::countr_zero(touch));
      if (level == 0) {
        see(child);
      } else {
        visit(level - 1, child, box, see);
      }
    }
  }
  void sort(const MeshBlocks& mesh);
  void bound(const MeshBlocks& mesh);

  const PairKernels& kernels_;
  Buffer<std::uint32_t> facet_;
  Buffer<Box> box_;
  std::vector<std::vector<BoxLanes>> levels_;  // [0]: boxes of groups
};

void FacetOrder::sort(const MeshBlocks& mesh) {
  Box all;
  for (const Box& box : mesh.bounds()) all.add(box);
  if (all.empty()) return;
  const Curve curve(all);
  Buffer<std::uint64_t> entry;
  entry.resize(std::size_t{mesh.cluster_count()} * kClusterSize);
  tbb::parallel_for(std::uint32_t{0}, mesh.cluster_count(), [&](std::uint32_t c) {
    Cluster slack;
    const Cluster& cluster = mesh.cluster(c, slack);
    for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
      const std::uint32_t number = c * kClusterSize + lane;
      const Triangle t = cluster.triangle(lane);
      entry[number] = Plane(t).flat() ? kNoFacet : std::uint64_t{curve.key(t)} << 32 | number;
    }
  });
  sort_entries(entry);
  facet_.resize(entry.size());
  for (std::size_t i = 0; i < entry.size(); ++i) facet_[i] = static_cast<std::uint32_t>(entry[i]);
}

void FacetOrder::bound(const MeshBlocks& mesh) {
  box_.resize(groups());
  tbb::parallel_for(std::uint32_t{0}, groups(), [&](std::uint32_t g) {
    Box box;
    for (const std::uint32_t number : facets(g)) box.add(box_of(facet_of(mesh, number)));
    box_[g] = box;
  });
  std::span<const Box> below = box_;
  std::vector<Box> around;
  while (!below.empty()) {
    std::vector<BoxLanes>& level = levels_.emplace_back((below.size() + kGroupSize - 1) / kGroupSize);
    std::vector<Box> next(level.size());
    for (std::uint32_t i = 0; i < below.size(); ++i) {
      level[i / kGroupSize].set(i % kGroupSize, below[i]);
      next[i / kGroupSize].add(below[i]);
    }
    if (level.size() == 1) break;
    around = std::move(next);
    below = around;
  }
}

// --- which facets meet.

using Wide = __int128;

constexpr std::size_t kMaxNeighbours = 4096;
constexpr std::uint32_t kGroupsAtOnce = 512;
constexpr std::uint32_t kMaxRays = 1 << 16;
constexpr std::uint32_t kDiscard = UINT32_MAX;

/// Of each facet, numbered cluster * kClusterSize + lane, those behind its three edges.
using Neighbours = Buffer<std::array<std::uint32_t, 3>>;

/// What is found out about facets, by many threads: what they write does not depend on who comes first.
class Findings {
 public:
  Findings(Suspects& suspects, Neighbours& neighbours) : suspects_(suspects), neighbours_(neighbours) {}

  void suspect(std::uint32_t facet) {
    std::atomic_ref(suspects_[facet / kClusterSize])
        .fetch_or(static_cast<std::uint16_t>(1u << facet % kClusterSize), std::memory_order_relaxed);
  }
  /// Behind that edge lies another; two of them are too many.
  void note(std::uint32_t facet, std::uint32_t edge, std::uint32_t other) {
    if (std::atomic_ref(neighbours_[facet][edge]).exchange(other, std::memory_order_relaxed) != kDiscard) suspect(facet);
  }
  bool has_all(std::uint32_t facet) const {
    return std::ranges::none_of(neighbours_[facet], [](std::uint32_t other) { return other == kDiscard; });
  }

 private:
  Suspects& suspects_;
  Neighbours& neighbours_;
};

/// All pairs of facets whose boxes touch, where they lie too far apart for kernels: decided one by one.
void far_pairs(const FacetGroup& a, const FacetGroup& b, Findings& findings) {
  for (std::uint32_t i = 0; i < a.used; ++i) {
    const Triangle one = a.facet(i);
    for (std::uint32_t k = &a == &b ? i + 1 : 0; k < b.used; ++k) {
      const Triangle other = b.facet(k);
      if (!boxes_meet(box_of(one), box_of(other))) continue;
      int shared = 0;
      bool meets = triangles_meet(Plane(one), Plane(other), shared);
      const std::array<Point3, 3> p{one.a, one.b, one.c}, q{other.a, other.b, other.c};
      for (std::uint32_t e = 0; e < 9; ++e) {
        const std::uint32_t from = e / 3, start = e % 3, to = (from + 1) % 3, end = (start + 1) % 3;
        meets |= p[from] == q[start] && p[to] == q[end];
        if (p[from] != q[end] || p[to] != q[start]) continue;
        findings.note(a.number[i], from, b.number[k]);
        findings.note(b.number[k], start, a.number[i]);
      }
      if (meets) findings.suspect(a.number[i]), findings.suspect(b.number[k]);
    }
  }
}

/// Groups as kernels take them; those of some groups are kept.
class GroupBuffer {
 public:
  GroupBuffer(const MeshBlocks& mesh, const FacetOrder& order) : mesh_(mesh), order_(order) {
    held_.resize(kHeld);
    number_.assign(kHeld, kDiscard);
  }
  const FacetGroup& of(std::uint32_t group) {
    FacetGroup& slack = held_[group % kHeld];
    if (number_[group % kHeld] != group) fill(group, slack);
    number_[group % kHeld] = group;
    return slack;
  }
  void fill(std::uint32_t group, FacetGroup& slack) const {
    slack.start();
    for (const std::uint32_t f : order_.facets(group)) slack.add(facet_of(mesh_, f), f);
  }

 private:
  static constexpr std::uint32_t kHeld = 256;  // 600 KB
  const MeshBlocks& mesh_;
  const FacetOrder& order_;
  Buffer<FacetGroup> held_;
  std::vector<std::uint32_t> number_;
};

void test_pairs(const FacetGroup& a, const FacetGroup& b, const Box& around_a, const Box& around_b, const PairKernels& kernels,
                FoundPairs& found, Findings& findings) {
  Box around = around_a;
  around.add(around_b);
  if (std::max({around.width(), around.depth(), around.height()}) > kWidestPair) return far_pairs(a, b, findings);
  kernels.pairs(a, b, around_b, found);
  for (std::uint32_t i = 0; i < found.edges; ++i) {
    const FoundPairs::FacetEdges& edge = found.edge[i];
    findings.note(a.number[edge.a], edge.edge_a, b.number[edge.b]);
    findings.note(b.number[edge.b], edge.edge_b, a.number[edge.a]);
  }
  const auto both = [&](const FoundPairs::Pair& pair) {
    findings.suspect(a.number[pair.a]);
    findings.suspect(b.number[pair.b]);
  };
  for (std::uint32_t i = 0; i < found.alikes; ++i) both(found.alike[i]);
  for (std::uint32_t i = 0; i < found.uncertain_count; ++i) {
    const FoundPairs::Pair& pair = found.uncertain[i];
    int shared = 0;
    if (triangles_meet(Plane(a.facet(pair.a)), Plane(b.facet(pair.b)), shared)) both(pair);
  }
}

/// Each pair of groups that touch is tested once: by the first of them, or by the other if that has too many others.
void test_neighbours(const MeshBlocks& mesh, const FacetOrder& order, const PairKernels& kernels, Findings& findings) {
  std::vector<std::uint8_t> crowded(order.groups());
  tbb::parallel_for(std::uint32_t{0}, order.groups(), [&](std::uint32_t g) {
    std::size_t others = 0;
    order.each(order.box(g), [&](std::uint32_t) { ++others; });
    crowded[g] = others > kMaxNeighbours ? 1 : 0;
  });
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, order.groups(), kGroupsAtOnce), [&](const auto& range) {
    GroupBuffer slack(mesh, order);
    FacetGroup own;
    const auto found = std::make_unique<FoundPairs>();
    for (std::uint32_t g = range.begin(); g < range.end(); ++g) {
      if (crowded[g] != 0) {
        for (const std::uint32_t f : order.facets(g)) findings.suspect(f);
        continue;
      }
      slack.fill(g, own);
      order.each(order.box(g), [&](std::uint32_t other) {
        if (other < g && crowded[other] == 0) return;
        test_pairs(own, other == g ? own : slack.of(other), order.box(g), order.box(other), kernels, *found, findings);
      });
    }
  });
  tbb::parallel_for(std::uint32_t{0}, order.groups(), [&](std::uint32_t g) {
    for (const std::uint32_t f : order.facets(g)) {
      if (!findings.has_all(f)) findings.suspect(f);
    }
  });
}

/// Where a line along x at an odd half-nanometre of y and z crosses a facet: whole + rest / divisor half-nanometres.
struct Hit {
  bool crosses = false;
  std::int64_t whole = 0;
  Wide rest = 0, divisor = 1;
};

Hit hit(const Plane& plane, std::int64_t y, std::int64_t z) {
  Hit result;
  const std::array<const Point3*, 3> p{&plane.facet.a, &plane.facet.b, &plane.facet.c};
  int turns = 0;
  for (int i = 0; i < 3; ++i) {
    const Point3 &a = *p[i], &b = *p[(i + 1) % 3];
    const Wide turn = static_cast<Wide>(2 * (std::int64_t{b.y} - a.y)) * (z - 2 * std::int64_t{a.z}) -
                      static_cast<Wide>(2 * (std::int64_t{b.z} - a.z)) * (y - 2 * std::int64_t{a.y});
    turns += turn > 0 ? 1 : turn < 0 ? -1 : 0;
  }
  if (plane.nx == 0 || std::abs(turns) != 3) {
    result.divisor = turns == 0 || std::abs(turns) == 1 ? 1 : 0;  // 0: on an edge, undetermined
    return result;
  }
  const Point3& a = plane.facet.a;
  Wide fall =
      static_cast<Wide>(plane.ny) * (y - 2 * std::int64_t{a.y}) + static_cast<Wide>(plane.nz) * (z - 2 * std::int64_t{a.z});
  fall = plane.nx > 0 ? -fall : fall;
  result.crosses = true;
  result.divisor = plane.nx > 0 ? static_cast<Wide>(plane.nx) : -static_cast<Wide>(plane.nx);
  const Wide whole = floor_div(fall, result.divisor);
  result.whole = 2 * std::int64_t{a.x} + static_cast<std::int64_t>(whole);
  result.rest = fall - whole * result.divisor;
  return result;
}

int compare(const Hit& a, const Hit& b) {
  if (a.whole != b.whole) return a.whole < b.whole ? -1 : 1;
  const Wide left = a.rest * b.divisor, right = b.rest * a.divisor;
  return left < right ? -1 : left > right ? 1 : 0;
}

/// Whether the winding number in front of the facet is 0, for certain.
bool has_nothing_before_it(const MeshBlocks& mesh, const IntervalTable<Nm>& index, const Plane& facet, std::uint32_t number) {
  const Triangle& t = facet.facet;
  const auto middle = [](std::int64_t a, std::int64_t b, std::int64_t c) {
    return 2 * floor_div(a + b + c, std::int64_t{3}) + 1;
  };
  const std::int64_t y = middle(t.a.y, t.b.y, t.c.y), z = middle(t.a.z, t.b.z, t.c.z);
  const Hit own = hit(facet, y, z);
  if (!own.crosses) return false;
  std::int64_t winding = facet.nx > 0 ? -1 : 0;  // in front of a facet that +x leaves through lies what is behind all others
  bool certain = true;
  Cluster slack;
  const std::int64_t below = floor_div(z, std::int64_t{2});
  index.find(below, below, [&](std::uint32_t c) {
    const Box& box = mesh.bounds()[c];
    if (!certain || 2 * std::int64_t{box.lo.y} > y || 2 * std::int64_t{box.hi.y} < y ||
        2 * std::int64_t{box.lo.x} > own.whole + 1) {
      return;
    }
    const Cluster& cluster = mesh.cluster(c, slack);
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      if (c * kClusterSize + i == number) continue;
      const Box of_facet = box_of(cluster.triangle(i));
      if (2 * std::int64_t{of_facet.lo.y} > y || 2 * std::int64_t{of_facet.hi.y} < y || 2 * std::int64_t{of_facet.lo.z} > z ||
          2 * std::int64_t{of_facet.hi.z} < z) {
        continue;
      }
      const Plane other(cluster.triangle(i));
      if (other.flat() || other.nx == 0) continue;
      const Hit at = hit(other, y, z);
      if (at.divisor == 0) certain = false;
      if (!at.crosses) continue;
      const int order = compare(at, own);
      if (order == 0) certain = false;
      if (order < 0) winding += other.nx < 0 ? 1 : -1;
    }
  });
  return certain && winding == 0;
}

/// Shells of facets that are not suspect yet become suspect unless nothing is in front of them.
void check_shells(const MeshBlocks& mesh, const IntervalTable<Nm>& index, const Neighbours& neighbours, Suspects& suspects) {
  const auto is_suspect = [&](std::uint32_t f) { return (suspects[f / kClusterSize] >> f % kClusterSize & 1) != 0; };
  std::vector<bool> detected(neighbours.size());
  std::vector<std::uint32_t> shell;
  std::uint32_t rays = 0;
  for (std::uint32_t first = 0; first < neighbours.size(); ++first) {
    if (detected[first] || is_suspect(first) || neighbours[first][0] == kDiscard) continue;
    shell.assign(1, first);
    detected[first] = true;
    std::uint32_t widest = first;
    double maximum = -1;
    for (std::size_t i = 0; i < shell.size(); ++i) {
      const double width = std::abs(static_cast<double>(Plane(facet_of(mesh, shell[i])).nx));
      if (width > maximum) maximum = width, widest = shell[i];
      for (const std::uint32_t next : neighbours[shell[i]]) {
        if (detected[next] || is_suspect(next)) continue;
        detected[next] = true;
        shell.push_back(next);
      }
    }
    const Plane facet(facet_of(mesh, widest));
    if (rays++ < kMaxRays && has_nothing_before_it(mesh, index, facet, widest)) continue;
    for (const std::uint32_t f : shell) {
      std::uint16_t& of_cluster = suspects[f / kClusterSize];
      of_cluster = static_cast<std::uint16_t>(of_cluster | 1u << f % kClusterSize);
    }
  }
}

}  // namespace

Suspects find_suspects(const MeshBlocks& mesh, const IntervalTable<Nm>& index, Isa isa) {
  const std::uint32_t clusters = mesh.cluster_count();
  Suspects suspects;
  suspects.assign(clusters, 0);
  Neighbours neighbours;
  neighbours.assign(std::size_t{clusters} * kClusterSize, {kDiscard, kDiscard, kDiscard});
  const PairKernels& kernels = pair_kernels_for(limited_isa(isa));
  Findings findings(suspects, neighbours);
  test_neighbours(mesh, FacetOrder(mesh, kernels), kernels, findings);
  check_shells(mesh, index, neighbours, suspects);
  return suspects;
}

}  // namespace lamina::coverage
