// stages/load/repair/diagnose.cpp: counts and places of everything that keeps a mesh from being a plain solid.
#include "stages/load/repair/diagnose.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <atomic>
#include <iterator>
#include <memory>
#include <utility>

#include "stages/geometry/boxes.h"
#include "stages/load/diagnosis/chunk_edges.h"
#include "stages/load/diagnosis/diagnosed_shells.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/vertices.h"

namespace lamina::load {
namespace {

/// More ends than this say little.
constexpr std::size_t kMaxEnds = 64;

}  // namespace

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
  const bool all_found =
      !result.shells_apart || for_each_overlap(boxes, [&](auto, auto) { return result.shells_apart = false; });
  result.shells_apart = result.shells_apart && all_found;
  const bool many = 2 * boxes.size() > kMaxEnds;
  for (const Box& box : many ? std::span<const Box>(&result.bounds, 1) : std::span<const Box>(boxes)) {
    result.shell_ends.push_back(box.lo.z);
    result.shell_ends.push_back(box.hi.z);
  }
  std::ranges::sort(result.shell_ends);
  result.shell_ends.erase(std::unique(result.shell_ends.begin(), result.shell_ends.end()), result.shell_ends.end());
}

namespace {

constexpr std::size_t kGrain = std::size_t{1} << 13;  // facets or vertices a task

using BlockedRange = tbb::blocked_range<std::uint32_t>;
BlockedRange all_of(std::size_t count) { return {0, static_cast<std::uint32_t>(count), kGrain}; }

/// What several tasks write while edges are inspected.
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
struct EdgeFindings {
  explicit EdgeFindings(std::size_t positions)
      : open(positions), non_manifold(positions), misoriented(positions), duplicate(positions) {}
  Collector open, non_manifold, misoriented, duplicate;
  std::uint64_t count = 0;
  bool balanced = true;

  std::vector<std::uint32_t> may_repeat;  // facets

  /// Inspects all sides of an edge. returns  whether facets at it may be there twice
  bool inspect(const Numbered& mesh, const Side* begin, const Side* end, Joined& joined) {
    ++count;
    joined.join(begin, end);
    if (end - begin == 2 && begin[0].forward != begin[1].forward) return false;
    balanced = balanced && surplus(begin, end) == 0;
    Collector& kind = end - begin == 1 ? open : end - begin == 2 ? misoriented : non_manifold;
    std::uint32_t first = UINT32_MAX;  // in the list
    for (const Side* side = begin; side != end; ++side) first = std::min(first, mesh.listed(side->facet));
    kind.add(first, mesh.vertices()[begin->low], mesh.vertices()[begin->high]);
    return end - begin > 1;
  }
  /// Inspects edges one after the other.
  void inspect(const Numbered& mesh, std::span<const Side> sides, Joined& joined) {
    for_each_edge(sides, [&](const Side* begin, const Side* end) {
      if (!inspect(mesh, begin, end, joined)) return;
      for (const Side* side = begin; side != end; ++side) may_repeat.push_back(side->facet);
    });
  }
  void add(const EdgeFindings& other) {
    open.add(other.open);
    non_manifold.add(other.non_manifold);
    misoriented.add(other.misoriented);
    duplicate.add(other.duplicate);
    count += other.count;
    balanced = balanced && other.balanced;
    may_repeat.insert(may_repeat.end(), other.may_repeat.begin(), other.may_repeat.end());
  }
};

/// Of parts that tasks inspect; results of one and the same parts are the same in any order.
template <class Findings, class Inspect>
Findings find_in(const BlockedRange& range, const Findings& nothing, const Inspect& inspect) {
  return tbb::parallel_reduce(
      range, nothing,
      [&](const BlockedRange& part, Findings visited) {
        inspect(part, visited);
        return visited;
      },
      [](Findings one, const Findings& other) {
        one.add(other);
        return one;
      });
}

/// Chunk by chunk, and then the sides that several chunks share.
EdgeFindings edges_of(const Numbered& mesh, std::size_t positions, Joined& joined) {
  constexpr std::size_t kPiece = std::size_t{1} << 17;  // sides, 2 MiB: one list of all would move when it grows
  struct Worker {
    ChunkEdges edges;
    ChunkPieces pieces;
    Buffer<Side> odd, rest;
    std::vector<Buffer<Side>> pieces_of_rest;
    Buffer<std::uint32_t> collapsed;
    EdgeFindings visited;
    explicit Worker(std::size_t max_reported) : visited(max_reported) {}
  };
  tbb::enumerable_thread_specific<std::unique_ptr<Worker>> workers([&] { return std::make_unique<Worker>(positions); });
  tbb::parallel_for(std::size_t{0}, mesh.chunks(), [&](std::size_t chunk) {
    Worker& worker = *workers.local();
    const auto first = static_cast<std::uint32_t>(chunk * Numbered::kChunk);
    if (worker.rest.size() + 3 * Numbered::kChunk > kPiece) worker.pieces_of_rest.push_back(std::exchange(worker.rest, {}));
    if (worker.rest.empty() && mesh.chunks() > 16) worker.rest.reserve(kPiece);
    const std::span<const ChunkEdges::Pair> pairs = worker.edges.find(mesh, chunk, worker.odd, worker.rest, worker.collapsed);
    worker.pieces.join(pairs, joined.sets.parents().subspan(first, mesh.local_facets(chunk).size()), first);
    worker.visited.count += pairs.size();
    worker.visited.inspect(mesh, worker.odd, joined);
  });
  std::vector<Buffer<Side>> rest;
  EdgeFindings within(positions);
  for (const std::unique_ptr<Worker>& worker : workers) {
    rest.push_back(std::move(worker->rest));
    std::ranges::move(worker->pieces_of_rest, std::back_inserter(rest));
    within.add(worker->visited);
    within.may_repeat.insert(within.may_repeat.end(), worker->collapsed.begin(), worker->collapsed.end());
  }
  const auto vertices = static_cast<std::uint32_t>(mesh.vertices().size());
  const SideLists lists(vertices, rest);
  std::vector<Buffer<Side>>().swap(rest);
  EdgeFindings visited = find_in(all_of(vertices), EdgeFindings(positions), [&](const BlockedRange& range, EdgeFindings& some) {
    for (std::uint32_t vertex = range.begin(); vertex != range.end(); ++vertex) some.inspect(mesh, lists.of(vertex), joined);
  });
  visited.add(within);
  for (const std::uint32_t i : repeats_among(mesh, visited.may_repeat)) {
    const Point3 corner = mesh.triangle(i).a;
    visited.duplicate.add(mesh.listed(i), corner, corner);
  }
  return visited;
}

/// The number of each facet's shell, by the smallest facets, in place of its parent, which comes before it; those that use a
/// vertex twice belong to none: UINT32_MAX. returns  how many
std::uint32_t number_shells(const Numbered& mesh, std::span<std::uint32_t> parents) {
  std::uint32_t shells = 0;
  for (std::uint32_t i = 0; i < parents.size(); ++i)
    parents[i] = parents[i] != i ? parents[parents[i]] : mesh.collapsed(i) ? UINT32_MAX : shells++;
  return shells;
}

/// ShellFindings by their numbers.
struct ShellFindings {
  std::vector<Shell> shell;

  /// Of chunks.
  void inspect(const Numbered& mesh, std::span<const std::uint32_t> shell_of, std::span<const std::uint8_t> unbalanced,
               const Point3& from, const BlockedRange& chunks) {
    Buffer<Point3> points;
    for (std::size_t c = chunks.begin(); c != chunks.end(); ++c) {
      const std::span<const std::uint32_t> numbers = mesh.numbers_of(c);
      points.resize(numbers.size());
      for (std::size_t v = 0; v < numbers.size(); ++v) points[v] = mesh.vertices()[numbers[v]];
      const std::span<const Numbered::Local> facets = mesh.local_facets(c);
      const std::size_t first = c * Numbered::kChunk;
      inspect(points, facets, shell_of.subspan(first, facets.size()), unbalanced.subspan(first, facets.size()), from);
    }
  }
  void add(const ShellFindings& other) {
    for (std::size_t s = 0; s < shell.size(); ++s) shell[s].add(other.shell[s]);
  }

 private:
  void inspect(std::span<const Point3> points, std::span<const Numbered::Local> facets, std::span<const std::uint32_t> shell_of,
               std::span<const std::uint8_t> unbalanced, const Point3& from) {
    const auto triangle = [&](const Numbered::Local& facet) {
      return Triangle{points[facet[0]], points[facet[1]], points[facet[2]]};
    };
    const std::uint32_t only = shell_of.front();
    if (only == UINT32_MAX || std::ranges::any_of(shell_of, [&](auto s) { return s != only; })) {
      for (std::size_t i = 0; i < facets.size(); ++i) {
        if (shell_of[i] == UINT32_MAX) continue;
        const Triangle t = triangle(facets[i]);
        Shell& one = shell[shell_of[i]];
        one.volume += load::sixfold_volume(t, from);
        for (const Point3& corner : {t.a, t.b, t.c}) one.box.add(corner);
        one.closed = one.closed && unbalanced[i] == 0;
      }
      return;
    }
    Shell here;
    for (const Numbered::Local& facet : facets) here.volume += load::sixfold_volume(triangle(facet), from);
    for (const Point3& point : points) here.box.add(point);
    here.closed = std::all_of(unbalanced.begin(), unbalanced.end(), [](std::uint8_t is) { return is == 0; });
    shell[only].add(here);
  }
};

/// Every task has a list of all shells of its own: where they are many, one task does it all.
constexpr std::uint32_t kManyShells = 1024;

/// What facets show one by one.
Diagnosis diagnose_facets(std::span<const Triangle> triangles, std::size_t positions) {
  Diagnosis result;
  result.triangles = triangles.size();
  DegenerateFacets degenerate(positions);
  tbb::parallel_for(all_of(triangles.size()), [&](const BlockedRange& range) {
    degenerate.inspect(range.begin(), triangles.subspan(range.begin(), range.size()));
  });
  result.degenerate_facets = degenerate.finding();
  return result;
}

/// What edges and shells show.
void diagnose_edges(const Numbered& mesh, std::size_t positions, Diagnosis& result) {
  result.vertices = mesh.vertices().size();
  result.bounds = find_in(all_of(result.vertices), Box(), [&](const BlockedRange& range, Box& box) {
    for (std::uint32_t i = range.begin(); i != range.end(); ++i) box.add(mesh.vertices()[i]);
  });
  Joined joined(mesh.size());
  {
    const EdgeFindings edges = edges_of(mesh, positions, joined);
    result.edges = edges.count;
    result.balanced = edges.balanced;
    result.open_edges = edges.open.finding();
    result.non_manifold_edges = edges.non_manifold.finding();
    result.misoriented_edges = edges.misoriented.finding();
    result.duplicate_facets = edges.duplicate.finding();
  }
  const std::uint32_t count = number_shells(mesh, joined.sets.parents());
  const std::span<const std::uint32_t> shell_of = joined.sets.parents();
  ShellFindings shells{std::vector<Shell>(count)};
  const auto measure = [&](const BlockedRange& range, ShellFindings& visited) {
    visited.inspect(mesh, shell_of, joined.unbalanced, result.bounds.lo, range);
  };
  const BlockedRange chunks(0, static_cast<std::uint32_t>(mesh.chunks()), 2);
  if (count > kManyShells)
    measure(chunks, shells);
  else
    shells = find_in(chunks, shells, measure);
  Int128 volume = 0;
  for (const Shell& shell : shells.shell) volume += shell.volume;
  result.volume_mm3 = static_cast<double>(volume) / 6e18;
  describe_shells(shells.shell, result);
}

}  // namespace

Diagnosis diagnose(const Mesh& mesh, std::size_t positions) {
  Diagnosis result = diagnose_facets(mesh.triangles, positions);
  diagnose_edges(Numbered(mesh.triangles, mesh.bounds), positions, result);
  return result;
}

Diagnosis diagnose_alone(Mesh& mesh, std::size_t positions) {
  Diagnosis result = diagnose_facets(mesh.triangles, positions);
  Numbered numbered(std::move(mesh.triangles), mesh.bounds);
  diagnose_edges(numbered, positions, result);
  mesh.triangles = result.shells_apart ? Buffer<Triangle>() : numbered.give_back_list();
  return result;
}

}  // namespace lamina::load
