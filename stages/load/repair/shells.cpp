#include "stages/load/repair/shells.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/boxes.h"
#include "stages/load/repair/census.h"
#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/surfaces.h"
#include "stages/load/repair/topology.h"
#include "stages/load/winding/winding.h"

namespace lamina::load {
namespace {

/// Of unit length; none for a facet without area.
WindingTree::Point normal_of(const Indexed& mesh, std::uint32_t facet) {
  const auto& [a, b, c] = mesh.facet[facet];
  const auto normal = doubled_area({mesh.vertex[a], mesh.vertex[b], mesh.vertex[c]});
  const WindingTree::Point n{static_cast<double>(normal[0]), static_cast<double>(normal[1]), static_cast<double>(normal[2])};
  const double length = std::sqrt(dot(n, n));
  return length > 0 ? WindingTree::Point{n[0] / length, n[1] / length, n[2] / length} : n;
}

/// Joins the facets at an edge that more than two share, each that is walked forward with one that is walked back: those that
/// are of one shell already, then those that continue each other most evenly. So each shell stays closed.
void join_pairs(const Indexed& mesh, const Side* begin, const Side* end, DisjointSets& sets) {
  struct Pair {
    double score;
    std::size_t forward, back;
  };
  constexpr std::ptrdiff_t kMany = 64;
  if (end - begin > kMany) {
    for (const Side* side = begin + 1; side != end; ++side) sets.join(begin->facet, side->facet);
    return;
  }
  std::vector<WindingTree::Point> normal;
  for (const Side* side = begin; side != end; ++side) normal.push_back(normal_of(mesh, side->facet));
  std::vector<Pair> pairs;
  for (std::size_t f = 0; f < normal.size(); ++f) {
    for (std::size_t b = 0; b < normal.size(); ++b) {
      if (!begin[f].forward || begin[b].forward) continue;
      pairs.push_back({sets.find(begin[f].facet) == sets.find(begin[b].facet) ? 2 : dot(normal[f], normal[b]), f, b});
    }
  }
  std::ranges::stable_sort(pairs, std::ranges::greater(), &Pair::score);
  std::vector<std::uint8_t> taken(normal.size(), 0);
  for (const Pair& pair : pairs) {
    if (taken[pair.forward] != 0 || taken[pair.back] != 0) continue;
    taken[pair.forward] = taken[pair.back] = 1;
    sets.join(begin[pair.forward].facet, begin[pair.back].facet);
  }
}

/// The shell of each facet, by its first facet.
Buffer<std::uint32_t> find_shells(const Indexed& mesh) {
  const Buffer<Side> sides = sorted_sides(mesh.facet);
  DisjointSets sets(mesh.facet.size());
  for_each_edge(std::span(sides), [&](const Side* begin, const Side* end) {
    if (end - begin == 2) sets.join(begin->facet, end[-1].facet);
  });
  for_each_edge(std::span(sides), [&](const Side* begin, const Side* end) {
    if (end - begin > 2) join_pairs(mesh, begin, end, sets);
  });
  Buffer<std::uint32_t> shell(mesh.facet.size());
  for (std::uint32_t f = 0; f < shell.size(); ++f) shell[f] = sets.find(f);
  return shell;
}

struct ClosedShell {
  std::vector<std::uint32_t> facets;
  Box box;
  Int128 sixfold_volume = 0;
  std::optional<WindingTree> tree;
  bool turned = false;
};

/// Whether `outer` contains `inner`.
class ShellContainment {
 public:
  ShellContainment(std::span<const Triangle> triangles, const Point3& origin) : triangles_(triangles), origin_(origin) {}

  bool operator()(ClosedShell& outer, const ClosedShell& inner) const {
    const Box &out = outer.box, &in = inner.box;
    const bool boxes = out.lo.x <= in.lo.x && out.lo.y <= in.lo.y && out.lo.z <= in.lo.z && in.hi.x <= out.hi.x &&
                       in.hi.y <= out.hi.y && in.hi.z <= out.hi.z;
    if (!boxes) return false;
    if (!outer.tree) {
      Buffer<Triangle> own;
      for (const std::uint32_t f : outer.facets) own.push_back(triangles_[f]);
      outer.tree.emplace(own, origin_);
    }
    const auto point = [&](const Point3& p) {
      return WindingTree::Point{static_cast<double>(p.x) - origin_.x, static_cast<double>(p.y) - origin_.y,
                                static_cast<double>(p.z) - origin_.z};
    };
    // No facet of one is near the other: one point decides.
    if (!outer.tree->meets(point(in.lo), point(in.hi)))
      return std::fabs(outer.tree->at(point(triangles_[inner.facets.front()].a))) > 0.5;
    return std::ranges::all_of(inner.facets, [&](std::uint32_t f) { return holds(*outer.tree, triangles_[f]); });
  }

 private:
  bool holds(const WindingTree& tree, const Triangle& t) const {
    constexpr double kOutside = 0.25;
    const std::array<Point3, 3> corner{t.a, t.b, t.c};
    const auto normal = doubled_area(t);
    const WindingTree::Point n{static_cast<double>(normal[0]), static_cast<double>(normal[1]), static_cast<double>(normal[2])};
    const double length = std::sqrt(dot(n, n)), off = length > 0 ? (1 + 1e-3 * std::sqrt(length)) / length : 0;
    const auto inside = [&](const std::array<double, 3>& weight) {
      WindingTree::Point at{};
      for (std::size_t k = 0; k < 3; ++k) {
        at[0] += weight[k] * (static_cast<double>(corner[k].x) - origin_.x);
        at[1] += weight[k] * (static_cast<double>(corner[k].y) - origin_.y);
        at[2] += weight[k] * (static_cast<double>(corner[k].z) - origin_.z);
      }
      // On a facet of the outer shell the winding number jumps: one of its sides is inside.
      const auto at_side = [&](double by) { return tree.at({at[0] + by * n[0], at[1] + by * n[1], at[2] + by * n[2]}); };
      return std::fabs(at_side(off)) > kOutside || std::fabs(at_side(-off)) > kOutside;
    };
    // Within the facet: at a sharp edge of the outer shell, on which this one lies, the winding number is anything.
    constexpr double kThird = 1.0 / 3, kNear = 0.96, kOff = 0.02, kHalf = 0.49;
    return inside({kThird, kThird, kThird}) && inside({kNear, kOff, kOff}) && inside({kOff, kNear, kOff}) &&
           inside({kOff, kOff, kNear}) && inside({kHalf, kHalf, kOff}) && inside({kOff, kHalf, kHalf}) &&
           inside({kHalf, kOff, kHalf});
  }

  std::span<const Triangle> triangles_;
  Point3 origin_;
};

std::vector<ClosedShell> shells_of(const Mesh& mesh) {
  const Indexed indexed = index_mesh(mesh.triangles);
  const Buffer<std::uint32_t> shell_of = find_shells(indexed);
  std::vector<ClosedShell> shells;
  std::vector<std::uint32_t> number(shell_of.size());
  for (std::uint32_t f = 0; f < shell_of.size(); ++f) {
    if (collapsed(indexed.facet[f])) continue;
    if (shell_of[f] == f) {
      number[f] = static_cast<std::uint32_t>(shells.size());
      shells.emplace_back();
    }
    ClosedShell& shell = shells[number[shell_of[f]]];
    const Triangle& t = mesh.triangles[f];
    shell.facets.push_back(f);
    shell.box.add(t.a), shell.box.add(t.b), shell.box.add(t.c);
    shell.sixfold_volume += sixfold_volume(t, mesh.triangles[shell_of[f]].a);  // a near tip, so that little cancels out
  }
  return shells;
}

/// Whether no shell can be inverted. Bodies with an edge in common are one shell to the diagnosis.
bool is_plain(const Diagnosis& found) { return found.inverted_shells == 0 && found.non_manifold_edges.count == 0; }

/// Of each shell of negative volume, in order, the shells whose boxes overlap its own.
std::vector<std::vector<std::uint32_t>> boxes_around(std::span<ClosedShell* const> shells) {
  std::vector<Box> boxes;
  for (const ClosedShell* shell : shells) boxes.push_back(shell->box);
  std::vector<std::vector<std::uint32_t>> around(shells.size());
  const auto note = [&](std::uint32_t inner, std::uint32_t outer) {
    if (shells[inner]->sixfold_volume < 0) around[inner].push_back(outer);
  };
  const bool all = for_each_overlap(boxes, [&](std::uint32_t i, std::uint32_t j) {
    note(i, j), note(j, i);
    return true;
  });
  for (std::uint32_t i = 0; i < shells.size(); ++i) {
    if (!all) {
      around[i].clear();
      for (std::uint32_t j = 0; j < shells.size(); ++j)
        if (j != i) note(i, j);
    }
    std::ranges::sort(around[i]);
  }
  return around;
}

}  // namespace

std::uint32_t turn_inverted_shells(Mesh& mesh) {
  std::vector<ClosedShell> shells = shells_of(mesh);
  const ShellContainment contains(mesh.triangles, mesh.bounds.lo);
  std::vector<ClosedShell*> by_size, inverted;  // the largest contains most hollows
  for (ClosedShell& shell : shells) by_size.push_back(&shell);
  std::ranges::stable_sort(by_size, std::ranges::greater(), [](const ClosedShell* shell) { return shell->facets.size(); });
  const std::vector<std::vector<std::uint32_t>> around = boxes_around(by_size);
  for (std::size_t i = 0; i < by_size.size(); ++i) {
    if (by_size[i]->sixfold_volume >= 0) continue;
    const auto holds = [&](std::uint32_t other) { return contains(*by_size[other], *by_size[i]); };
    if (std::ranges::none_of(around[i], holds)) inverted.push_back(by_size[i]);
  }
  if (inverted.empty()) return 0;
  for (ClosedShell* outer : inverted) {
    outer->turned = true;
    for (ClosedShell& shell : shells) {
      if (&shell == outer || !contains(*outer, shell)) continue;
      // A hollow of a sound body that overlaps this one may lie in both.
      const auto is_its_body = [&](ClosedShell& other) {
        return &other != &shell && other.sixfold_volume > 0 && contains(other, shell) && !contains(*outer, other);
      };
      shell.turned |= shell.sixfold_volume > 0 || std::ranges::none_of(shells, is_its_body);
    }
  }
  for (const ClosedShell& shell : shells) {
    if (!shell.turned) continue;
    for (const std::uint32_t f : shell.facets) std::swap(mesh.triangles[f].b, mesh.triangles[f].c);
  }
  const Census found = census(mesh.triangles, mesh.bounds.middle().z);
  mesh.fingerprint = found.fingerprint;
  mesh.volume_mm3 = found.volume_mm3;
  return static_cast<std::uint32_t>(inverted.size());
}

bool turn_shells(Mesh& mesh, const std::string& prefix, std::vector<Note>& notes) {
  if (!mesh.closed) return false;
  if (mesh.blocks) {
    const bool is_large = mesh.blocks->triangle_count() > kBlockSize;
    if (is_large && !may_have_negative_surface(*mesh.blocks)) return false;
    mesh.triangles = list_of(*mesh.blocks);
    if (!is_large && is_plain(diagnose(mesh, 0))) {
      mesh.triangles = {};
      return false;
    }
  } else if (is_plain(diagnose(mesh, 0))) {
    return false;
  }
  const std::uint32_t turned = turn_inverted_shells(mesh);
  if (turned > 0) {
    mesh.blocks.reset();
    notes.push_back(
        {true, fmt::format("{}{} inside out, and turned over: no other shell contains {}", prefix,
                           turned == 1 ? "a shell is" : fmt::format("{} shells are", turned), turned == 1 ? "it" : "them")});
  } else if (mesh.blocks) {
    mesh.triangles = {};
  }
  return turned > 0;
}

}  // namespace lamina::load
