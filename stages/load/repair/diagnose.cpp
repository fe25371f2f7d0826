// stages/load/repair/diagnose.cpp: counts and places of everything that keeps a mesh from being a plain solid.
#include "stages/load/repair/diagnose.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <atomic>

#include "stages/load/repair/geometry.h"
#include "stages/load/repair/overlaps.h"
#include "stages/load/repair/stars.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/vertices.h"

namespace lamina::load {
namespace {

Point3 middle(const Point3& p, const Point3& q) {
  const auto half = [](Nm one, Nm other) { return static_cast<Nm>((std::int64_t{one} + other) / 2); };
  return {half(p.x, q.x), half(p.y, q.y), half(p.z, q.z)};
}

/// Counts, and keeps the `places` with the smallest triangles, of one triangle the lowest edges.
class Collector {
 public:
  explicit Collector(std::size_t places) : places_(places) {}

  /// At an edge between two points, or at a point.
  void add(std::uint32_t triangle, const Point3& p, const Point3& q) {
    ++count_;
    keep({triangle, std::min(p, q), std::max(p, q)});
  }
  void add(const Collector& other) {
    count_ += other.count_;
    for (const Found& found : other.first_) keep(found);
  }
  Diagnosis::Finding finding() const {
    Diagnosis::Finding result{count_, {}};
    for (const Found& found : first_) result.first.push_back({found.triangle, middle(found.low, found.high)});
    return result;
  }

 private:
  struct Found {
    std::uint32_t triangle;
    Point3 low, high;
    friend auto operator<=>(const Found&, const Found&) = default;
  };
  void keep(const Found& found) {
    if (first_.size() == places_ && (places_ == 0 || first_.back() <= found)) return;
    if (first_.size() == places_) first_.pop_back();
    first_.insert(std::upper_bound(first_.begin(), first_.end(), found), found);
  }

  std::size_t places_;
  std::uint64_t count_ = 0;
  std::vector<Found> first_;
};

struct Shell {
  Int128 volume = 0;  // sixfold
  Box box;
  bool closed = true;

  void add(const Shell& other) {
    volume += other.volume;
    box.add(other.box);
    closed = closed && other.closed;
  }
};

/// More ends than this say little.
constexpr std::size_t kMostEnds = 64;

void describe_shells(std::span<const Shell> shells, Diagnosis& result) {
  result.shells = static_cast<std::uint32_t>(shells.size());
  Int128 outward = 0;
  std::vector<Box> boxes;
  for (const Shell& shell : shells) {
    if (shell.closed && shell.volume < 0) ++result.inverted_shells;
    outward += shell.volume < 0 ? -shell.volume : shell.volume;
    boxes.push_back(shell.box);
  }
  result.outward_mm3 = static_cast<double>(outward) / 6e18;
  result.shells_apart = result.non_manifold_edges.count == 0;
  const bool all_seen =
      !result.shells_apart || for_each_overlap(boxes, [&](auto, auto) { return result.shells_apart = false; });
  result.shells_apart = result.shells_apart && all_seen;
  const bool many = 2 * boxes.size() > kMostEnds;
  for (const Box& box : many ? std::span<const Box>(&result.bounds, 1) : std::span<const Box>(boxes)) {
    result.shell_ends.push_back(box.lo.z);
    result.shell_ends.push_back(box.hi.z);
  }
  std::ranges::sort(result.shell_ends);
  result.shell_ends.erase(std::unique(result.shell_ends.begin(), result.shell_ends.end()), result.shell_ends.end());
}

constexpr std::size_t kGrain = std::size_t{1} << 13;  // facets or vertices a task

using Range = tbb::blocked_range<std::uint32_t>;
Range all_of(std::size_t count) { return {0, static_cast<std::uint32_t>(count), kGrain}; }

/// What facets show one by one.
struct SeenFacets {
  Collector degenerate;
  Box box;

  void look(std::span<const Triangle> triangles, const Range& range) {
    for (std::uint32_t i = range.begin(); i != range.end(); ++i) {
      const Triangle& t = triangles[i];
      for (const Point3& corner : {t.a, t.b, t.c}) box.add(corner);
      if (!has_area(t)) degenerate.add(i, t.a, t.a);
    }
  }
  void add(const SeenFacets& other) {
    degenerate.add(other.degenerate);
    box.add(other.box);
  }
};

/// What several tasks write while edges are looked at.
struct Joined {
  explicit Joined(std::size_t facets) : sets(facets), unbalanced(facets, 0) {}
  DisjointSets sets;                     // of facets that share edges
  std::vector<std::uint8_t> unbalanced;  // facets at edges that are not walked as often one way as the other

  void join(const Side* begin, const Side* end) {
    for (const Side* side = begin + 1; side < end; ++side) sets.join(begin->facet, side->facet);
    if (surplus(begin, end) == 0) return;
    for (const Side* side = begin; side != end; ++side)
      std::atomic_ref<std::uint8_t>(unbalanced[side->facet]).store(1, std::memory_order_relaxed);
  }
};

/// What edges show.
struct SeenEdges {
  explicit SeenEdges(std::size_t places) : open(places), non_manifold(places), misoriented(places), duplicate(places) {}
  Collector open, non_manifold, misoriented, duplicate;
  std::uint64_t count = 0;
  bool balanced = true;

  void look(const Numbered& mesh, const Stars& stars, const Range& range, Joined& joined) {
    Buffer<Side> sides;
    std::vector<std::uint32_t> repeats;
    for (std::uint32_t vertex = range.begin(); vertex != range.end(); ++vertex) {
      bool odd = stars.sides_of(vertex, sides);  // where facets may be there twice
      for_each_edge(sides, [&](const Side* begin, const Side* end) {
        ++count;
        joined.join(begin, end);
        if (end - begin == 2 && begin[0].forward != begin[1].forward) return;
        odd = odd || end - begin > 1;
        balanced = balanced && surplus(begin, end) == 0;
        Collector& kind = end - begin == 1 ? open : end - begin == 2 ? misoriented : non_manifold;
        kind.add(begin->facet, mesh.vertices()[begin->low], mesh.vertices()[begin->high]);
      });
      if (odd) stars.repeats_of(vertex, repeats);
    }
    for (const std::uint32_t i : repeats) {
      const Point3 corner = mesh.triangle(i).a;
      duplicate.add(i, corner, corner);
    }
  }
  void add(const SeenEdges& other) {
    open.add(other.open);
    non_manifold.add(other.non_manifold);
    misoriented.add(other.misoriented);
    duplicate.add(other.duplicate);
    count += other.count;
    balanced = balanced && other.balanced;
  }
};

/// Of parts that tasks look at; results of one and the same parts are the same in any order.
template <class Seen, class Look>
Seen seen_in(const Range& range, const Seen& nothing, const Look& look) {
  return tbb::parallel_reduce(
      range, nothing,
      [&](const Range& part, Seen seen) {
        look(part, seen);
        return seen;
      },
      [](Seen one, const Seen& other) {
        one.add(other);
        return one;
      });
}

/// The number of each facet's shell, by the smallest facets; those that use a vertex twice belong to none: UINT32_MAX.
/// shells: how many
Buffer<std::uint32_t> numbered_shells(const Numbered& mesh, std::span<const std::uint32_t> parents, std::uint32_t& shells) {
  Buffer<std::uint32_t> shell_of(parents.size());
  shells = 0;
  for (std::uint32_t i = 0; i < parents.size(); ++i)
    shell_of[i] = parents[i] != i ? shell_of[parents[i]] : collapsed(mesh.facets()[i]) ? UINT32_MAX : shells++;
  return shell_of;
}

/// SeenShells by their numbers.
struct SeenShells {
  std::vector<Shell> shell;

  void look(const Numbered& mesh, std::span<const std::uint32_t> shell_of, std::span<const std::uint8_t> unbalanced,
            const Point3& from, const Range& range) {
    for (std::uint32_t i = range.begin(); i != range.end(); ++i) {
      if (shell_of[i] == UINT32_MAX) continue;
      const Triangle t = mesh.triangle(i);
      Shell& one = shell[shell_of[i]];
      one.volume += load::sixfold_volume(t, from);
      for (const Point3& corner : {t.a, t.b, t.c}) one.box.add(corner);
      one.closed = one.closed && unbalanced[i] == 0;
    }
  }
  void add(const SeenShells& other) {
    for (std::size_t s = 0; s < shell.size(); ++s) shell[s].add(other.shell[s]);
  }
};

/// Every task has a list of all shells of its own: where they are many, one task does it all.
constexpr std::uint32_t kManyShells = 1024;

/// What facets show one by one.
Diagnosis diagnose_facets(std::span<const Triangle> triangles, std::size_t places) {
  Diagnosis result;
  result.triangles = triangles.size();
  const SeenFacets facets = seen_in(all_of(triangles.size()), SeenFacets{Collector(places), {}},
                                    [&](const Range& range, SeenFacets& seen) { seen.look(triangles, range); });
  result.bounds = facets.box;
  result.degenerate_facets = facets.degenerate.finding();
  return result;
}

/// What edges and shells show.
void diagnose_edges(const Numbered& mesh, std::size_t places, Diagnosis& result) {
  const std::size_t triangles = mesh.facets().size();
  result.vertices = mesh.vertices().size();
  Joined joined(triangles);
  {
    const Stars stars(mesh);
    const SeenEdges edges = seen_in(all_of(stars.vertices()), SeenEdges(places),
                                    [&](const Range& range, SeenEdges& seen) { seen.look(mesh, stars, range, joined); });
    result.edges = edges.count;
    result.balanced = edges.balanced;
    result.open_edges = edges.open.finding();
    result.non_manifold_edges = edges.non_manifold.finding();
    result.misoriented_edges = edges.misoriented.finding();
    result.duplicate_facets = edges.duplicate.finding();
  }
  std::uint32_t count = 0;
  const Buffer<std::uint32_t> shell_of = numbered_shells(mesh, joined.sets.parents(), count);
  SeenShells shells{std::vector<Shell>(count)};
  const auto measure = [&](const Range& range, SeenShells& seen) {
    seen.look(mesh, shell_of, joined.unbalanced, result.bounds.lo, range);
  };
  if (count > kManyShells)
    measure(all_of(triangles), shells);
  else
    shells = seen_in(all_of(triangles), shells, measure);
  Int128 volume = 0;
  for (const Shell& shell : shells.shell) volume += shell.volume;
  result.volume_mm3 = static_cast<double>(volume) / 6e18;
  describe_shells(shells.shell, result);
}

}  // namespace

Diagnosis diagnose(const Mesh& mesh, std::size_t places) {
  Diagnosis result = diagnose_facets(mesh.triangles, places);
  diagnose_edges(Numbered(mesh.triangles), places, result);
  return result;
}

Diagnosis diagnose_alone(Mesh& mesh, std::size_t places) {
  Diagnosis result = diagnose_facets(mesh.triangles, places);
  Numbered numbered(std::move(mesh.triangles));
  diagnose_edges(numbered, places, result);
  mesh.triangles = result.shells_apart ? Buffer<Triangle>() : numbered.give_back_list();
  return result;
}

}  // namespace lamina::load
