// stages/load/repair/repair.cpp: the steps, over one indexed mesh.
#include "stages/load/repair/repair.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/topology.h"

namespace lamina::load {
namespace {

struct StraySheets {
  Buffer<std::uint8_t> drop;  // for each facet whether it belongs to one
  std::uint64_t sheets = 0;
};

/// A patch is what hangs together over edges with two facets. A stray sheet is a patch with an open rim that meets
/// other facets only along edges which are unmatched with it and balanced without it: a fin that was left on a solid.
/// Capping its rim would invent a body as wide as the fin. An open shell that merely touches another one is none: it
/// leaves the edges where they touch as balanced as they are. Where two such patches meet, neither is dropped.
/// cost  O(T) after sorting
StraySheets find_stray_sheets(std::size_t facet_count, std::span<const Side> sides) {
  DisjointSets patches(facet_count);
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    if (end - begin == 2) patches.join(begin[0].facet, begin[1].facet);
  });

  struct Rim {
    bool open = false, glued = false, needed = false;  // needed: something would be unbalanced without the patch
  };
  Buffer<Rim> rims(facet_count, Rim{});
  struct OwnSides {
    std::uint32_t patch;
    std::int32_t direction;  // 1 from low to high, -1 back
  };
  std::vector<OwnSides> meeting;  // at one edge; a broken file may have all its facets there
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    if (end - begin == 2) return;
    meeting.clear();
    for (const Side* side = begin; side != end; ++side) meeting.push_back({patches.find(side->facet), side->forward ? 1 : -1});
    std::ranges::sort(meeting, {}, &OwnSides::patch);
    const std::int64_t all = surplus(begin, end);
    for (auto first = meeting.begin(), last = first; first != meeting.end(); first = last) {
      std::int64_t own = 0;
      for (; last != meeting.end() && last->patch == first->patch; ++last) own += last->direction;
      Rim& rim = rims[first->patch];
      if (last - first == end - begin) {
        rim.open = rim.open || all != 0;
      } else {
        rim.glued = true;
        rim.needed = rim.needed || all == 0 || all != own;
      }
    }
  });
  const auto is_candidate = [&](std::uint32_t patch) {
    const Rim& rim = rims[patch];
    return rim.open && rim.glued && !rim.needed;
  };
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    const std::uint32_t first = patches.find(begin->facet);
    for (const Side* side = begin + 1; side < end; ++side) {
      const std::uint32_t patch = patches.find(side->facet);
      if (patch == first || !is_candidate(patch) || !is_candidate(first)) continue;
      rims[patch].needed = rims[first].needed = true;
    }
  });

  StraySheets stray;
  stray.drop.resize(facet_count);
  for (std::uint32_t facet = 0; facet < facet_count; ++facet) {
    const std::uint32_t patch = patches.find(facet);
    stray.drop[facet] = is_candidate(patch);
    stray.sheets += stray.drop[facet] && patch == facet;
  }
  return stray;
}

/// A piece's plane: through a vertex, with the sum of all normals turned to the side of the first.
struct SheetPiece {
  bool open = false, flat = true;
  Point3 at{};
  std::array<double, 3> normal{};
  Box box;
};

std::array<double, 3> doubled_normal(const Indexed& mesh, const Indexed::Facet& facet) {
  const auto area = doubled_area({mesh.vertex[facet[0]], mesh.vertex[facet[1]], mesh.vertex[facet[2]]});
  return {static_cast<double>(area[0]), static_cast<double>(area[1]), static_cast<double>(area[2])};
}

/// Pieces that cannot enclose anything: facets that hang together over vertices, with open edges, all of whose vertices
/// lie within `tolerance_nm` or a thousandth of the piece's size of a plane. A loose facet is one. A cap would put a
/// second sheet upon them.
/// cost  O(T) after sorting
StraySheets find_flat_pieces(const Indexed& mesh, std::span<const Side> sides, std::int64_t tolerance_nm) {
  DisjointSets pieces(mesh.vertex.size());
  for (const Indexed::Facet& facet : mesh.facet) {
    pieces.join(facet[0], facet[1]);
    pieces.join(facet[1], facet[2]);
  }
  std::vector<SheetPiece> piece(mesh.vertex.size());
  for (const Indexed::Facet& facet : mesh.facet) {
    SheetPiece& own = piece[pieces.find(facet[0])];
    own.at = mesh.vertex[facet[0]];
    for (const std::uint32_t corner : facet) own.box.add(mesh.vertex[corner]);
    const auto normal = doubled_normal(mesh, facet);
    const double along = normal[0] * own.normal[0] + normal[1] * own.normal[1] + normal[2] * own.normal[2];
    for (std::size_t k = 0; k < 3; ++k) own.normal[k] += along < 0 ? -normal[k] : normal[k];
  }
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    if (surplus(begin, end) != 0) piece[pieces.find(begin->low)].open = true;
  });
  for (const Indexed::Facet& facet : mesh.facet) {
    SheetPiece& own = piece[pieces.find(facet[0])];
    const auto& n = own.normal;
    const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const double maximum = std::max(static_cast<double>(tolerance_nm), diagonal_nm(own.box) / 1000) * length;
    for (const std::uint32_t corner : facet) {
      const Point3& p = mesh.vertex[corner];
      const double off = n[0] * (static_cast<double>(p.x) - own.at.x) + n[1] * (static_cast<double>(p.y) - own.at.y) +
                         n[2] * (static_cast<double>(p.z) - own.at.z);
      own.flat = own.flat && std::fabs(off) <= maximum;
    }
  }

  StraySheets stray;
  stray.drop.resize(mesh.facet.size());
  Buffer<std::uint8_t> counted(mesh.vertex.size(), std::uint8_t{0});
  for (std::size_t f = 0; f < mesh.facet.size(); ++f) {
    const std::uint32_t representative = pieces.find(mesh.facet[f][0]);
    stray.drop[f] = piece[representative].open && piece[representative].flat;
    stray.sheets += stray.drop[f] && !counted[representative];
    counted[representative] = 1;
  }
  return stray;
}

using Facet = Indexed::Facet;

/// Sum over all edges of how much more often they are walked one way than the other; 0 is balanced.
std::uint64_t imbalance(std::span<const Side> sides) {
  std::uint64_t sum = 0;
  for_each_edge(sides,
                [&](const Side* begin, const Side* end) { sum += static_cast<std::uint64_t>(std::abs(surplus(begin, end))); });
  return sum;
}

/// The mesh under repair: triangles and facets are two views of the same list.
struct RepairWork {
  Mesh& mesh;
  Indexed indexed;
  Buffer<Side> sides;
  std::uint64_t unmatched = 0;

  explicit RepairWork(Mesh& to_repair) : mesh(to_repair), indexed(index_mesh(to_repair.triangles)) { refresh(); }
  void refresh() {
    sides = {};
    sides = sorted_sides(indexed.facet);
    unmatched = imbalance(sides);
  }
};

std::uint64_t drop(RepairWork& work, std::span<const std::uint8_t> unwanted) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < unwanted.size(); ++i) {
    if (unwanted[i]) continue;
    work.indexed.facet[kept] = work.indexed.facet[i];
    work.mesh.triangles[kept++] = work.mesh.triangles[i];
  }
  const std::size_t dropped = unwanted.size() - kept;
  if (dropped == 0) return 0;
  work.indexed.facet.resize(kept);
  work.mesh.triangles.resize(kept);
  work.refresh();
  return dropped;
}

/// Volume between a facet and where it goes to, as far as the facet says, nm3.
double moved_volume(const Triangle& from, const Triangle& to) {
  const auto off = [](const Triangle& t, auto axis) {
    return static_cast<double>(std::int64_t{t.a.*axis} + t.b.*axis + t.c.*axis);
  };
  const auto normal = doubled_area(from);
  return (static_cast<double>(normal[0]) * (off(to, &Point3::x) - off(from, &Point3::x)) +
          static_cast<double>(normal[1]) * (off(to, &Point3::y) - off(from, &Point3::y)) +
          static_cast<double>(normal[2]) * (off(to, &Point3::z) - off(from, &Point3::z))) /
         6;
}

void weld(RepairWork& work, const WeldRange& range, RepairReport& report) {
  const Welding welding = weld(work.indexed, work.sides, range);
  if (welding.joined == 0) return;
  report.vertices_welded = welding.joined;
  report.weld_nm = welding.distance_nm;
  double squares = 0;
  for (std::size_t i = 0; i < work.indexed.facet.size(); ++i) {
    const Facet& facet = work.indexed.facet[i];
    const Triangle welded = {work.indexed.vertex[facet[0]], work.indexed.vertex[facet[1]], work.indexed.vertex[facet[2]]};
    const double moved = moved_volume(work.mesh.triangles[i], welded) * 1e-18;
    squares += moved * moved;
    work.mesh.triangles[i] = welded;
  }
  report.weld_moved_mm3 = std::sqrt(squares);
  work.indexed = index_mesh(work.mesh.triangles);
  work.refresh();
}

/// Which facets to turn over so that neighbours agree. Neighbours are the two facets of an edge that has two.
Buffer<std::uint8_t> find_orientation(const RepairWork& work) {
  const std::size_t count = work.indexed.facet.size();
  struct Neighbour {
    std::uint32_t facet = UINT32_MAX;
    bool agrees = true;
  };
  Buffer<std::array<Neighbour, 3>> neighbours(count);
  Buffer<std::uint8_t> used(count, 0), turn(count, 0), visited(count, 0);
  for_each_edge(work.sides, [&](const Side* begin, const Side* end) {
    if (end - begin != 2 || begin[0].facet == begin[1].facet) return;
    const bool agrees = begin[0].forward != begin[1].forward;
    neighbours[begin[0].facet][used[begin[0].facet]++] = {begin[1].facet, agrees};
    neighbours[begin[1].facet][used[begin[1].facet]++] = {begin[0].facet, agrees};
  });
  Buffer<std::uint32_t> component;
  for (std::uint32_t start = 0; start < count; ++start) {
    if (visited[start]) continue;
    component.clear();
    component.push_back(start);
    visited[start] = 1;
    double kept_area = 0, turned_area = 0;
    bool any_turned = false;
    for (std::size_t i = 0; i < component.size(); ++i) {
      const std::uint32_t facet = component[i];
      (turn[facet] ? turned_area : kept_area) += doubled_area_length(work.mesh.triangles[facet]);
      any_turned = any_turned || turn[facet];
      for (std::size_t k = 0; k < used[facet]; ++k) {
        const Neighbour& next = neighbours[facet][k];
        if (visited[next.facet]) continue;
        visited[next.facet] = 1;
        turn[next.facet] = next.agrees ? turn[facet] : static_cast<std::uint8_t>(!turn[facet]);
        component.push_back(next.facet);
      }
    }
    if (any_turned && turned_area > kept_area)
      for (const std::uint32_t facet : component) turn[facet] = !turn[facet];
  }
  return turn;
}

/// Turning is undone if it leaves more unmatched than there was (surfaces with one side, crossings of many sheets).
std::uint64_t orient(RepairWork& work) {
  const Buffer<std::uint8_t> turn = find_orientation(work);
  const auto turned = static_cast<std::uint64_t>(std::count(turn.begin(), turn.end(), std::uint8_t{1}));
  if (turned == 0) return 0;
  const auto apply = [&] {
    for (std::size_t i = 0; i < turn.size(); ++i) {
      if (!turn[i]) continue;
      std::swap(work.indexed.facet[i][1], work.indexed.facet[i][2]);
      std::swap(work.mesh.triangles[i].b, work.mesh.triangles[i].c);
    }
    work.refresh();
  };
  const std::uint64_t unmatched = work.unmatched;
  apply();
  if (work.unmatched <= unmatched) return turned;
  apply();
  return 0;
}

/// Takes the edges that facets walk more often one way than the other, turned around, apart into loops that visit no
/// vertex twice, and calls cap(loop) for each: vertices in order, the smallest first, at least three. Walks begin at
/// the smallest vertex and go to the smallest next one; a loop is cut off as soon as a vertex comes again, so that
/// openings that touch in a vertex stay apart.
///
/// Every edge finds its loop: a facet enters and leaves each of its vertices equally often, hence so do the surplus
/// edges, and a walk that entered a vertex can leave it.
/// source  a walk with a stack, after Hierholzer (1873), cut at every vertex that comes again
template <class Cap>
void for_each_loop(std::span<const Side> sides, const Cap& cap) {
  Buffer<std::pair<std::uint32_t, std::uint32_t>> edges;  // as caps walk them
  for_each_edge(sides, [&](const Side* begin, const Side* end) {
    for (std::int64_t left = surplus(begin, end); left != 0; left -= left > 0 ? 1 : -1)
      edges.push_back(left > 0 ? std::pair{begin->high, begin->low} : std::pair{begin->low, begin->high});
  });
  std::sort(edges.begin(), edges.end());

  // Vertices as positions in a short list, each with the range of its edges that are still to be walked.
  Buffer<std::uint32_t> vertices, next, end;
  for (std::uint32_t i = 0; i < edges.size(); ++i) {
    if (i == 0 || edges[i].first != edges[i - 1].first) {
      vertices.push_back(edges[i].first);
      next.push_back(i);
      end.push_back(i);
    }
    ++end.back();
  }
  const auto position = [&](std::uint32_t vertex) {
    return static_cast<std::uint32_t>(std::lower_bound(vertices.begin(), vertices.end(), vertex) - vertices.begin());
  };
  Buffer<std::uint8_t> on_stack(vertices.size(), std::uint8_t{0});
  Buffer<std::uint32_t> stack, loop;
  for (std::uint32_t start = 0; start < vertices.size(); ++start) {
    while (next[start] != end[start] || !stack.empty()) {
      if (stack.empty()) {
        stack.push_back(start);
        on_stack[start] = 1;
      }
      const std::uint32_t at = stack.back();
      if (next[at] == end[at]) {  // only the start can be left without edges, when its loops are done
        stack.clear();
        on_stack[at] = 0;
        break;
      }
      const std::uint32_t to = position(edges[next[at]++].second);
      if (!on_stack[to]) {
        on_stack[to] = 1;
        stack.push_back(to);
        continue;
      }
      loop.clear();
      while (true) {
        const std::uint32_t back = stack.back();
        loop.push_back(vertices[back]);
        if (back == to) break;
        on_stack[back] = 0;
        stack.pop_back();
      }
      std::reverse(loop.begin(), loop.end());
      std::rotate(loop.begin(), std::min_element(loop.begin(), loop.end()), loop.end());
      cap(loop);
    }
  }
}

void cap(RepairWork& work, RepairReport& report) {
  const auto& vertex = work.indexed.vertex;
  for_each_loop(work.sides, [&](std::span<const std::uint32_t> loop) {
    Box box;
    for (const std::uint32_t v : loop) box.add(vertex[v]);
    const double width = mm(box.width()), depth = mm(box.depth()), height = mm(box.height());
    const double diagonal = std::sqrt(width * width + depth * depth + height * height);
    if (diagonal > report.largest_opening_mm) {
      report.largest_opening_mm = diagonal;
      report.largest_opening = box;
    }
    for (std::size_t i = 2; i < loop.size(); ++i)
      work.mesh.triangles.push_back({vertex[loop[0]], vertex[loop[i - 1]], vertex[loop[i]]});
    ++report.openings_capped;
    report.cap_triangles += loop.size() - 2;
  });
}

}  // namespace

RepairReport repair(Mesh& mesh, const WeldRange& range, bool caps) {
  RepairReport report;
  mesh.repaired_from = static_cast<std::uint32_t>(mesh.triangles.size());
  if (census(mesh.triangles).balanced) return report;
  RepairWork work(mesh);
  if (work.unmatched > 0) report.duplicates_dropped = drop(work, repeats(work.indexed.facet));
  if (work.unmatched > 0 && range.start_nm > 0) weld(work, range, report);
  if (work.unmatched > 0 && report.vertices_welded > 0) report.duplicates_dropped += drop(work, repeats(work.indexed.facet));
  if (work.unmatched > 0) report.facets_turned = orient(work);
  if (work.unmatched > 0 && caps) {
    const StraySheets stray = find_stray_sheets(work.indexed.facet.size(), work.sides);
    report.sheets_dropped = stray.sheets;
    report.sheet_facets_dropped = drop(work, stray.drop);
  }
  report.volume_before_mm3 = census(mesh.triangles, mesh.bounds.middle().z).volume_mm3;
  if (work.unmatched > 0 && caps) {
    const StraySheets flat = find_flat_pieces(work.indexed, work.sides, report.weld_nm);
    report.flat_dropped = flat.sheets;
    report.flat_facets_dropped = drop(work, flat.drop);
  }
  if (report.sheets_dropped + report.flat_dropped + report.vertices_welded > 0) {
    mesh.bounds = {};
    for (const Triangle& t : mesh.triangles) mesh.bounds.add(t.a), mesh.bounds.add(t.b), mesh.bounds.add(t.c);
  }
  mesh.repaired_from = static_cast<std::uint32_t>(mesh.triangles.size());
  if (work.unmatched > 0 && caps) cap(work, report);
  return report;
}

bool turn_over_if_inside_out(Mesh& mesh) {
  if (!mesh.closed || mesh.volume_mm3 >= 0) return false;
  for (Triangle& t : mesh.triangles) std::swap(t.b, t.c);
  const Census found = census(mesh.triangles, mesh.bounds.middle().z);
  mesh.fingerprint = found.fingerprint;
  mesh.volume_mm3 = found.volume_mm3;
  return true;
}

double capped_share(const Mesh& mesh) {
  const std::size_t count = mesh.triangles.size(), own = std::min<std::size_t>(mesh.repaired_from, count);
  if (own == count) return 0;
  double area = 0, caps = 0;
  for (std::size_t i = 0; i < count; ++i) (i < own ? area : caps) += doubled_area_length(mesh.triangles[i]);
  return caps > 0 ? caps / (area + caps) : 0;
}

}  // namespace lamina::load
