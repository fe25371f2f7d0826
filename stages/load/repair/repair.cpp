// stages/load/repair/repair.cpp: the steps, over one indexed mesh.
#include "stages/load/repair/repair.h"

#include <algorithm>
#include <cmath>

#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/sheets.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/weld.h"

namespace lamina::load {
namespace {

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
  Buffer<std::uint8_t> used(count), turn(count), visited(count);
  std::fill(used.begin(), used.end(), std::uint8_t{0});
  std::fill(turn.begin(), turn.end(), std::uint8_t{0});
  std::fill(visited.begin(), visited.end(), std::uint8_t{0});
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

void cap(RepairWork& work, RepairReport& report) {
  const auto& vertex = work.indexed.vertex;
  for_each_loop(work.sides, [&](std::span<const std::uint32_t> loop) {
    Box box;
    for (const std::uint32_t v : loop) box.add(vertex[v]);
    report.capped.add(box);
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
