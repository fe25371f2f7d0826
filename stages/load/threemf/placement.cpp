#include "stages/load/threemf/placement.h"

#include <fmt/core.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/text.h"

namespace lamina::load {
namespace {

using BlockedRange = tbb::blocked_range<std::size_t>;

struct SnappedMesh {
  Facets facets;
  std::array<double, 3> margin{0.5, 0.5, 0.5};  // nm, by axis: how far the nearest coordinate is from being rounded otherwise
};

struct SnappedVertices {
  Buffer<Point3> at;
  Buffer<Snapped> how;
  std::array<double, 3> margin;
};

std::array<double, 3> minimum(const std::array<double, 3>& one, const std::array<double, 3>& other) {
  return {std::min(one[0], other[0]), std::min(one[1], other[1]), std::min(one[2], other[2])};
}

SnappedVertices snap_vertices(const ModelObject& object, const Transform& transform) {
  const Snapper snapper(transform, 1.0);
  SnappedVertices out;
  const std::size_t count = object.vertices.size();
  out.at.resize(count);
  out.how.resize(count);
  out.margin = tbb::parallel_reduce(
      BlockedRange(0, count, 1 << 13), std::array<double, 3>{0.5, 0.5, 0.5},
      [&](const BlockedRange& range, std::array<double, 3> margin) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const auto& v = object.vertices[i];
          Point3& p = out.at[i];
          out.how[i] = snapper.snap(v[0], v[1], v[2], p);
          if (out.how[i] != Snapped::kYes) continue;
          const std::array<double, 3> moved = multiply(transform.linear, v);
          const std::array<Nm, 3> whole{p.x, p.y, p.z};
          for (std::size_t axis = 0; axis < 3; ++axis) {
            const double nm = (moved[axis] + transform.translation[axis]) * 1e6;
            margin[axis] = std::min(margin[axis], 0.5 - std::fabs(nm - static_cast<double>(whole[axis])));
          }
        }
        return margin;
      },
      minimum);
  return out;
}

struct GatheredFacets {
  Box bounds;
  bool bad = false;  // a triangle has a corner that cannot be snapped
};

/// Snaps each vertex once and puts the triangles together, turned over if the transform mirrors.
///
/// label      of the object, for errors
/// transform  from the numbers of the file to mm
/// errors     kInput: a corner that is not finite, unless options.drop_bad, or beyond reach
/// cost       parallel; 13 bytes a vertex besides the facets
Result<SnappedMesh> snap_mesh(const Source& source, const ModelObject& object, const std::string& label,
                              const Transform& transform, const LoadOptions& options) {
  const SnappedVertices vertices = snap_vertices(object, transform);
  const bool mirrors = transform.mirrors();
  SnappedMesh mesh;
  mesh.margin = vertices.margin;
  Buffer<Triangle>& triangles = mesh.facets.triangles;
  const std::size_t count = object.triangles.size();
  triangles.resize(count);
  const auto is = [&](std::size_t i) {
    const auto& [a, b, c] = object.triangles[i];
    return std::max({vertices.how[a], vertices.how[b], vertices.how[c]});
  };
  const GatheredFacets gathered = tbb::parallel_reduce(
      BlockedRange(0, count, 1 << 13), GatheredFacets{},
      [&](const BlockedRange& range, GatheredFacets so_far) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const auto& [a, b, c] = object.triangles[i];
          Triangle& t = triangles[i];
          t = {vertices.at[a], vertices.at[mirrors ? c : b], vertices.at[mirrors ? b : c]};
          if (is(i) != Snapped::kYes)
            so_far.bad = true;
          else
            so_far.bounds.add(t.a), so_far.bounds.add(t.b), so_far.bounds.add(t.c);
        }
        return so_far;
      },
      [](GatheredFacets one, const GatheredFacets& other) {
        one.bounds.add(other.bounds);
        one.bad = one.bad || other.bad;
        return one;
      });
  mesh.facets.bounds = gathered.bounds;
  if (!gathered.bad) return mesh;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Snapped snapped = is(i);
    if (snapped == Snapped::kYes)
      triangles[kept++] = triangles[i];
    else if (snapped == Snapped::kBeyondReach || !options.drop_bad)
      return source.error(fmt::format("{}, triangle {}: {}", label, i + 1, what_is_wrong(snapped)));
  }
  triangles.resize(kept);
  mesh.facets.notes.push_back({true, fmt::format("{} triangles with coordinates that are not finite dropped", count - kept)});
  return mesh;
}

constexpr std::size_t kMaxTried = 8;  // variants that a leaf is compared with before its vertices are snapped

/// Of the triangles relative to their first corner: equal for copies at any position.
std::uint64_t relative_hash(const Buffer<Triangle>& triangles) {
  std::uint64_t hash = triangles.size();
  if (triangles.empty()) return hash;
  const Point3 from = triangles.front().a;
  for (const Triangle& t : triangles) {
    for (const Point3& p : {t.a, t.b, t.c}) {
      const auto x = static_cast<std::uint32_t>(std::int64_t{p.x} - from.x),
                 y = static_cast<std::uint32_t>(std::int64_t{p.y} - from.y),
                 z = static_cast<std::uint32_t>(std::int64_t{p.z} - from.z);
      hash = (hash ^ x) * 0x9e3779b97f4a7c15ull;
      hash = (hash ^ (std::uint64_t{y} << 32 | z)) * 0xd6e8feb86659fd93ull;
      hash ^= hash >> 32;
    }
  }
  return hash;
}

/// Whether two meshes are the same but for a translation, and which.
bool is_moved_copy(const Facets& original, const Facets& copy, Point3& offset) {
  if (original.triangles.size() != copy.triangles.size() || original.bounds.empty()) return false;
  const std::int64_t x = std::int64_t{copy.bounds.lo.x} - original.bounds.lo.x,
                     y = std::int64_t{copy.bounds.lo.y} - original.bounds.lo.y,
                     z = std::int64_t{copy.bounds.lo.z} - original.bounds.lo.z;
  if (std::max({std::abs(x), std::abs(y), std::abs(z)}) > kNmReach) return false;
  offset = {static_cast<Nm>(x), static_cast<Nm>(y), static_cast<Nm>(z)};
  const auto moved = [&](const Point3& p, const Point3& q) { return p.x + x == q.x && p.y + y == q.y && p.z + z == q.z; };
  return std::equal(
      original.triangles.begin(), original.triangles.end(), copy.triangles.begin(),
      [&](const Triangle& p, const Triangle& q) { return moved(p.a, q.a) && moved(p.b, q.b) && moved(p.c, q.c); });
}

/// What the terms of a coordinate may come to, in nm, by axis.
std::array<double, 3> reach_of(const ModelObject& object, const Matrix& linear) {
  std::array<double, 3> largest{};
  for (const auto& v : object.vertices) {
    for (std::size_t axis = 0; axis < 3; ++axis) largest[axis] = std::max(largest[axis], std::fabs(v[axis]));
  }
  Matrix sizes = linear;
  for (double& one : sizes) one = std::fabs(one);
  std::array<double, 3> reach = multiply(sizes, largest);
  for (double& one : reach) one *= 1e6;
  return reach;
}

/// Whether a mesh is closed and of negative volume.
bool is_inside_out(const Facets& facets) {
  const Point3 from = facets.bounds.lo;
  const Int128 volume = tbb::parallel_reduce(
      BlockedRange(0, facets.triangles.size(), 1 << 14), Int128{0},
      [&](const BlockedRange& range, Int128 sum) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) sum += sixfold_volume(facets.triangles[i], from);
        return sum;
      },
      [](Int128 one, Int128 other) { return one + other; });
  return volume < 0 && census(facets.triangles).balanced;
}

class Placement {
 public:
  Placement(const Source& source, const ModelPackage& model, const LoadOptions& options, Package& to)
      : source_(source), model_(model), options_(options), to_(to) {}

  Status add(std::span<const Leaf> leaves) {
    std::vector<std::uint32_t> voids;  // by their containers
    for (std::uint32_t i = 0; i < leaves.size(); ++i)
      if (leaves[i].container != Leaf::kSolid) voids.push_back(i);
    std::stable_sort(voids.begin(), voids.end(),
                     [&](std::uint32_t one, std::uint32_t other) { return leaves[one].container < leaves[other].container; });
    auto next = voids.begin();
    for (std::uint32_t i = 0; i < leaves.size(); ++i) {
      if (leaves[i].container != Leaf::kSolid) continue;
      const auto end = std::find_if(next, voids.end(), [&](std::uint32_t inner) { return leaves[inner].container != i; });
      const Status added = next == end ? add_solid(leaves[i]) : add_hollow(leaves[i], leaves, {next, end});
      if (!added) return added;
      next = end;
    }
    return {};
  }

 private:
  using Axes = std::array<double, 3>;
  /// One way in which the vertices of an object are snapped.
  struct Variant {
    std::size_t object;  // index in Package::objects
    Axes translation;    // nm
    Axes margin;         // nm: what may be added to every coordinate before one is rounded otherwise
    Axes reach;          // nm: bound of the terms that add up to a coordinate, translation aside
  };
  struct TurnedObject {
    std::vector<Variant> variants;
    std::multimap<std::uint64_t, std::size_t> by_hash;  // of variants, by their triangles relative to the first corner
  };
  /// An object, its transform but for the translation, and whether it has voids.
  using Turn = std::tuple<std::uint32_t, std::array<double, 9>, bool>;

  /// Translations that differ by whole nanometres and a rest: no coordinate is rounded otherwise where the rest, and what
  /// arithmetic may add to it, stay below the margin.
  bool share_known(const TurnedObject& turned, const Axes& translation) {
    constexpr double kRounding = 4e-15;  // some 36 units in the last place of the sum of all terms
    const std::size_t maximum = std::min(turned.variants.size(), kMaxTried);
    for (std::size_t i = 0; i < maximum; ++i) {
      const Variant& variant = turned.variants[i];
      PlacedObject& object = to_.objects[variant.object];
      const Box& box = object.facets.bounds;
      const std::array<Nm, 3> lo{box.lo.x, box.lo.y, box.lo.z}, hi{box.hi.x, box.hi.y, box.hi.z};
      std::array<Nm, 3> offset{};
      bool same = !box.empty();
      for (std::size_t axis = 0; axis < 3 && same; ++axis) {
        const double moved = translation[axis] - variant.translation[axis];
        if (!(std::fabs(moved) < 4e9)) return false;
        const std::int64_t whole = nearest(moved);
        const double terms = variant.reach[axis] + std::fabs(translation[axis]) + std::fabs(variant.translation[axis]);
        const double rest = std::fabs(moved - static_cast<double>(whole)) + kRounding * terms;
        same = (moved == 0 || rest < variant.margin[axis]) && std::abs(whole) <= kNmReach && lo[axis] + whole >= -kNmReach &&
               hi[axis] + whole <= kNmReach;
        offset[axis] = static_cast<Nm>(same ? whole : 0);
      }
      if (!same) continue;
      object.offsets.push_back({offset[0], offset[1], offset[2]});
      return true;
    }
    return false;
  }

  bool share_equal(const TurnedObject& turned, const Facets& facets, std::uint64_t hash) {
    const auto [begin, end] = turned.by_hash.equal_range(hash);
    for (auto at = begin; at != end; ++at) {
      PlacedObject& object = to_.objects[turned.variants[at->second].object];
      Point3 offset{};
      if (!is_moved_copy(object.facets, facets, offset)) continue;
      object.offsets.push_back(offset);
      return true;
    }
    return false;
  }

  /// A mesh of the solid and of what is inside out within it, which is the same for copies of the whole.
  Status add_hollow(const Leaf& leaf, std::span<const Leaf> leaves, std::span<const std::uint32_t> voids) {
    const Transform transform = after(options_.transform, leaf.transform);
    const std::string name = label(model_, model_.objects[leaf.object]);
    Result<SnappedMesh> mesh = snap_mesh(source_, model_.objects[leaf.object], name, transform, options_);
    if (!mesh) return mesh.error();
    Facets& facets = mesh->facets;
    for (const std::uint32_t index : voids) {
      const Leaf& inner = leaves[index];
      const ModelObject& object = model_.objects[inner.object];
      Result<SnappedMesh> hollow =
          snap_mesh(source_, object, label(model_, object), after(options_.transform, inner.transform), options_);
      if (!hollow) return hollow.error();
      // What the container lacks is capped afterwards, around the void; a void that is open itself is no void for sure.
      if (!is_inside_out(hollow->facets)) {
        if (const Status added = add_solid(inner); !added) return added;
        continue;
      }
      if (reported_.insert(inner.object).second)
        to_.notes.push_back({false, label(model_, object) +
                                        " is inside out within another object of its build item: it is a void, as 3MF has it"});
      const std::size_t count = facets.triangles.size();
      facets.triangles.resize(count + hollow->facets.triangles.size());
      std::copy(hollow->facets.triangles.begin(), hollow->facets.triangles.end(), facets.triangles.begin() + count);
      facets.bounds.add(hollow->facets.bounds);
      std::move(hollow->facets.notes.begin(), hollow->facets.notes.end(), std::back_inserter(facets.notes));
    }
    TurnedObject& turned = turns_[{leaf.object, transform.linear, true}];
    const std::uint64_t hash = relative_hash(facets.triangles);
    if (share_equal(turned, facets, hash)) return {};
    turned.by_hash.emplace(hash, turned.variants.size());
    turned.variants.push_back({to_.objects.size(), {}, {}, {}});
    to_.objects.push_back({name, std::move(facets), {{0, 0, 0}}});
    return {};
  }

  Status add_solid(const Leaf& leaf) {
    const ModelObject& object = model_.objects[leaf.object];
    const Transform transform = after(options_.transform, leaf.transform);
    Axes translation = transform.translation;
    for (double& axis : translation) axis *= 1e6;
    TurnedObject& turned = turns_[{leaf.object, transform.linear, false}];
    if (share_known(turned, translation)) return {};
    const std::string name = label(model_, object);
    Result<SnappedMesh> mesh = snap_mesh(source_, object, name, transform, options_);
    if (!mesh) return mesh.error();
    const std::uint64_t hash = relative_hash(mesh->facets.triangles);
    if (share_equal(turned, mesh->facets, hash)) return {};
    turned.by_hash.emplace(hash, turned.variants.size());
    turned.variants.push_back({to_.objects.size(), translation, mesh->margin, reach_of(object, transform.linear)});
    to_.objects.push_back({name, std::move(mesh->facets), {{0, 0, 0}}});
    return {};
  }

  const Source& source_;
  const ModelPackage& model_;
  const LoadOptions& options_;
  Package& to_;
  std::map<Turn, TurnedObject> turns_;
  std::set<std::uint32_t> reported_;  // voids
};

}  // namespace

Status snap_leaves(const Source& source, const ModelPackage& model, std::span<const Leaf> leaves, const LoadOptions& options,
                   Package& to) {
  return Placement(source, model, options, to).add(leaves);
}

}  // namespace lamina::load
