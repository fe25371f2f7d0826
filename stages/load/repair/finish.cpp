// stages/load/repair/finish.cpp: census, repair, what to say of them, and which --weld would make a solid of what is none.
#include "stages/load/repair/finish.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/enclosed.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/repair.h"
#include "stages/load/repair/shells.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/weld.h"
#include "stages/load/winding/winding.h"

namespace lamina::load {
namespace {

/// Triangles that are welded for advice, over all distances.
constexpr std::uint64_t kMaxWelded = std::uint64_t{1} << 24;

std::uint64_t open_edges(std::span<const Side> sides) {
  std::uint64_t open = 0;
  for_each_edge(sides, [&](const Side* begin, const Side* end) { open += end - begin == 1; });
  return open;
}

/// Whether a repaired mesh is a solid. errors  kInput, without a file: why it is none
Status check_solid(const Mesh& mesh, const RepairReport& report) {
  const auto hollow = [](std::string why) { return Error{Fault::kInput, std::move(why)}; };
  if (mesh.triangles.empty()) return hollow("its facets are unconnected and enclose nothing");
  const Enclosed held = enclosed(mesh);
  if (held.nothing()) return hollow("its facets enclose nothing");
  const double before = std::fabs(report.volume_before_mm3);
  if (held.volume_mm3 >= before / 2) return {};
  return hollow(fmt::format("its facets are separate: closing them leaves {:.4g} of some {:.4g} mm3", held.volume_mm3, before));
}

/// By how much of itself the volume of a welded mesh may be off: 0.02 is 2 %. Corners that lie apart by chance lie as far from
/// where they belong as from each other; twice their standard deviation.
double weld_uncertainty(const Mesh& mesh, const RepairReport& report) {
  const double volume = std::fabs(census(mesh.triangles, mesh.bounds.middle().z).volume_mm3);
  return report.weld_moved_mm3 > 0 && volume > 0 ? 2 * report.weld_moved_mm3 / volume : 0;
}

bool makes_a_solid(const Buffer<Triangle>& triangles, const Box& bounds, std::int64_t distance) {
  Mesh mesh;
  mesh.triangles = triangles;
  mesh.bounds = bounds;
  const RepairReport report = repair(mesh, distance);
  return check_solid(mesh, report) && capped_share(mesh) < 0.1;
}

/// The smallest distance, doubled again and again, at which the facets become a solid that hardly depends on caps; 0 if none is
/// found: up to a twentieth of the size, and up to what any edge allows (weld.h).
///
/// tried  distances up to this one are known to close nothing
/// cost   a weld for each distance, a repair for those that close most edges; fewer distances for more than 8 million
///        triangles, so that it takes no longer than two more repairs of such a mesh
std::int64_t weld_that_closes(const Buffer<Triangle>& triangles, const Box& bounds, std::int64_t tried_nm) {
  Indexed indexed = index_mesh(triangles);
  const Buffer<std::uint8_t> repeated = repeats(indexed.facet);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < repeated.size(); ++i)
    if (!repeated[i]) indexed.facet[kept++] = indexed.facet[i];
  indexed.facet.resize(kept);
  const Buffer<Side> sides = sorted_sides(indexed.facet);
  const std::uint64_t open = open_edges(sides);
  const auto maximum = std::min(static_cast<std::int64_t>(diagonal_nm(bounds) / 20), 2 * farthest_weld(indexed));
  std::uint64_t left = std::max(kMaxWelded, 2 * triangles.size());
  for (std::int64_t distance = kWeldByItself; distance <= maximum; distance *= 2) {
    if (distance <= tried_nm) continue;
    if (left < triangles.size()) break;
    left -= triangles.size();
    Indexed welded = indexed;
    Buffer<Side> joined = sides;
    if (weld(welded, joined, distance).joined == 0 || 4 * open_edges(joined) > open) continue;
    if (makes_a_solid(triangles, bounds, distance)) return distance;
  }
  return 0;
}

std::string plural(std::uint64_t count, const char* what) { return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s"); }

/// Of a volume: what a weld may change without a word, and at all unless its distance is given.
constexpr double kReportedUncertainty = 0.01, kMaxUncertainty = 0.03;

std::string position(const Box& box) {
  const Point3 at = box.middle();
  return fmt::format("({:.3f}, {:.3f}, {:.3f}) mm", mm(at.x), mm(at.y), mm(at.z));
}

/// Repair notes end with the positions of the file's own coordinates, so that they can be found in a modeller.
/// uncertainty  of the weld
void describe_repair(const RepairReport& report, double uncertainty, const std::string& prefix, std::vector<Note>& notes) {
  const auto note = [&](const std::string& text) { notes.push_back({true, prefix + text}); };
  if (report.duplicates_dropped > 0) note(plural(report.duplicates_dropped, "duplicate facet") + " dropped");
  if (report.vertices_welded > 0)
    note(fmt::format(
        "{} {} at open edges welded to a neighbour within {:.6g} um{}", report.vertices_welded,
        report.vertices_welded == 1 ? "vertex" : "vertices", static_cast<double>(report.weld_nm) / 1000,
        uncertainty >= kReportedUncertainty ? fmt::format(": the volume may be off by {:.2g} %", 100 * uncertainty) : ""));
  if (report.facets_turned > 0) note(plural(report.facets_turned, "facet") + " turned over to agree with the neighbours");
  if (report.sheets_dropped > 0)
    note(fmt::format("{} with {} dropped (an open rim, attached to the solid, enclosing nothing)",
                     plural(report.sheets_dropped, "stray surface"), plural(report.sheet_facets_dropped, "facet")));
  if (report.flat_dropped > 0)
    note(fmt::format("{} with {} dropped (loose, and flat: enclosing nothing)", plural(report.flat_dropped, "surface"),
                     plural(report.flat_facets_dropped, "facet")));
  if (report.openings_capped > 0)
    note(fmt::format("{} capped with {}, the largest {:.3g} mm wide near {}", plural(report.openings_capped, "opening"),
                     plural(report.cap_triangles, "triangle"), report.largest_opening_mm, position(report.largest_opening)));
}

/// Sides that no other facet shares, over all sides.
double open_share(std::span<const Triangle> triangles) {
  const Buffer<Side> sides = sorted_sides(index_mesh(triangles).facet);
  return sides.empty() ? 1 : static_cast<double>(open_edges(sides)) / static_cast<double>(sides.size());
}

/// A plane, a line or a point.
bool is_flat(const Mesh& mesh) {
  return std::min({mesh.bounds.width(), mesh.bounds.depth(), mesh.bounds.height()}) <= 0 ||
         std::none_of(mesh.triangles.begin(), mesh.triangles.end(), has_area);
}

/// Decides which facets of a file whose length contradicts its header are taken. `found` is kept up to date.
/// errors  kInput: neither all of them nor those that the header speaks of
Status settle_warning(const Source& source, const ReadWarning& warning, Mesh& mesh, Census& found, std::vector<Note>& notes) {
  const std::span<const Triangle> all(mesh.triangles.data(), mesh.triangles.size());
  if (warning.claimed == 0 || warning.claimed >= all.size()) {
    if (!found.balanced) return source.error(warning.error);
    notes.push_back({false, warning.note});
    return {};
  }
  const Census first = census(all.first(warning.claimed), mesh.bounds.middle().z);
  // Behind a closed mesh, padding with zeros closes too, but encloses nothing.
  const bool rest_counts = std::fabs(found.volume_mm3 - first.volume_mm3) > 1e-9 * std::fabs(first.volume_mm3);
  bool whole = found.balanced && (!first.balanced || rest_counts);
  if (!whole && !first.balanced) {
    // Rubbish fits nowhere; facets fit as well as those before them.
    whole = open_share(all) <= 1.001 * open_share(all.first(warning.claimed));
    if (whole)
      notes.push_back({true, fmt::format("the header says {} facets, the file holds {}, which fit together: all are read",
                                         warning.claimed, all.size())});
  } else if (whole) {
    notes.push_back({true, warning.note});
  }
  if (whole) return {};
  notes.push_back({false, warning.rest_left_out});
  mesh.triangles.resize(warning.claimed);
  mesh.bounds = {};
  for (const Triangle& t : mesh.triangles) mesh.bounds.add(t.a), mesh.bounds.add(t.b), mesh.bounds.add(t.c);
  found = census(mesh.triangles, mesh.bounds.middle().z);
  return {};
}

/// 5 um goes up to 160 um, or a hundredth of a small mesh's size; any other distance is taken as it is.
WeldRange weld_range(const LoadOptions& options, const Box& bounds) {
  if (options.weld_nm != kWeldByItself) return options.weld_nm;
  const auto maximum = static_cast<std::int64_t>(std::min(160e3, diagonal_nm(bounds) / 100));
  return {options.weld_nm, std::max(options.weld_nm, maximum)};
}

/// Closes a mesh by its winding number, after welding and turning facets over.
/// errors  kInput: nothing is left
Status close_by_winding(const Source& source, const std::string& prefix, const LoadOptions& options, Mesh& mesh, Census& found,
                        std::vector<Note>& notes) {
  const RepairReport report = repair(mesh, weld_range(options, mesh.bounds), false);
  describe_repair(report, weld_uncertainty(mesh, report), prefix, notes);
  found = census(mesh.triangles, mesh.bounds.middle().z);
  if (!found.balanced) {
    const std::size_t facets = mesh.triangles.size();
    const double cell_mm = remesh(mesh);
    found = census(mesh.triangles, mesh.bounds.middle().z);
    if (!found.balanced)
      return Error{Fault::kInternal, std::string(source.path()) + ": remeshing left the mesh open; please report it"};
    notes.push_back(
        {true, fmt::format("{}approximate: {} facets became {} where the winding number is a half, found in cells of "
                           "{:.4g} mm; what is thinner may be lost",
                           prefix, facets, mesh.triangles.size(), cell_mm)});
  }
  if (mesh.triangles.empty() || enclosed(mesh).nothing())
    return source.error(prefix + "its facets enclose nothing, by their winding number too; export it as a solid");
  return {};
}

/// errors  kInput: what is left is no solid, or may be another one
Status close(const Source& source, const std::string& prefix, const LoadOptions& options, Mesh& mesh, Census& found,
             std::vector<Note>& notes) {
  const Buffer<Triangle> original = mesh.triangles;
  const Box bounds = mesh.bounds;
  const WeldRange range = weld_range(options, bounds);
  const RepairReport report = repair(mesh, range);
  found = census(mesh.triangles, mesh.bounds.middle().z);
  if (!found.balanced)
    return Error{Fault::kInternal, std::string(source.path()) + ": repair left the mesh open; please report it"};
  if (const Status solid = check_solid(mesh, report); !solid) {
    const std::int64_t distance = weld_that_closes(original, bounds, range.max_nm);
    return source.error(prefix + solid.error().message +
                        (distance > 0 ? fmt::format("; --weld {} closes it", distance / 1000)
                                      : "; export it as a solid, or try --repair winding"));
  }
  const double uncertainty = weld_uncertainty(mesh, report);
  if (uncertainty > kMaxUncertainty && options.weld_nm == kWeldByItself) {
    const std::int64_t distance = weld_that_closes(original, bounds, report.weld_nm - 1);
    return source.error(fmt::format(
        "{}its open edges are separated by up to {:.6g} um: joining them may change its volume by {:.2g} %; export it as a "
        "solid{}",
        prefix, static_cast<double>(report.weld_nm) / 1000, 100 * uncertainty,
        distance > 0 ? fmt::format(", or say --weld {} if that will do", distance / 1000) : ""));
  }
  describe_repair(report, uncertainty, prefix, notes);
  return {};
}

/// Names shells that cancel each other in a closed mesh.
/// errors  kInput: nothing else is there
Status check_cancelled(const Source& source, const std::string& prefix, const Mesh& mesh, const Census& found,
                       std::vector<Note>& notes) {
  const double box = mm(mesh.bounds.width()) * mm(mesh.bounds.depth()) * mm(mesh.bounds.height());
  const bool hardly_any = std::fabs(found.volume_mm3) <= kHardlyAny * box;
  if (found.reversed_twins) {
    const Cancelled cancelled = find_cancelled(mesh);
    if (cancelled.facets == mesh.triangles.size() && cancelled.facets > 0)
      return source.error(prefix +
                          "every facet is there twice, once turned over: all of it cancels out; delete one of the two");
    if (cancelled.shells > 0)
      notes.push_back({true, fmt::format("{}{} with {} out near {}: there twice, once inside out, and not solid; delete one of "
                                         "each two",
                                         prefix, plural(cancelled.shells, "shell"),
                                         plural(cancelled.facets, "facet") + (cancelled.shells == 1 ? " cancels" : " cancel"),
                                         position(cancelled.box))});
  }
  if ((hardly_any || found.reversed_twins) && enclosed(mesh).nothing())
    return source.error(prefix + "its facets enclose nothing: nothing to print");
  return {};
}

}  // namespace

Result<Mesh> finish(const Source& source, const std::string& name, const std::string& prefix, Facets facets,
                    const LoadOptions& options, std::vector<Note>& notes) {
  Mesh mesh;
  mesh.name = name;
  mesh.triangles = std::move(facets.triangles);
  mesh.bounds = facets.bounds;
  mesh.repaired_from = static_cast<std::uint32_t>(mesh.triangles.size());
  for (Note& note : facets.notes) notes.push_back({note.repair, prefix + note.text});
  Census found = census(mesh.triangles, mesh.bounds.middle().z);
  if (facets.warning) {
    const Status settled = settle_warning(source, *facets.warning, mesh, found, notes);
    if (!settled) return settled.error();
    mesh.repaired_from = static_cast<std::uint32_t>(mesh.triangles.size());
  }
  const bool flat = is_flat(mesh);
  if (!found.balanced && options.repair && flat) {
    mesh.triangles.clear();
    found = census({});
    notes.push_back({false, prefix + "is planar: nothing of it is solid"});
  } else if (!found.balanced && options.repair && options.winding) {
    if (const Status closed = close_by_winding(source, prefix, options, mesh, found, notes); !closed) return closed.error();
  } else if (!found.balanced && options.repair) {
    if (const Status closed = close(source, prefix, options, mesh, found, notes); !closed) return closed.error();
  } else if (!found.balanced) {
    mesh.closed = false;
    notes.push_back({false, prefix + "the mesh is not closed and repair is off: rows of it may stay open"});
  }
  const bool turns_shells = mesh.closed && options.repair && options.turn_shells && !flat;
  if (turns_shells && found.volume_mm3 >= 0 && turn_shells(mesh, prefix, notes))
    found = census(mesh.triangles, mesh.bounds.middle().z);
  if (mesh.closed && options.repair && !flat) {
    if (const Status solid = check_cancelled(source, prefix, mesh, found, notes); !solid) return solid.error();
  }
  mesh.fingerprint = found.fingerprint;
  mesh.volume_mm3 = found.volume_mm3;
  mesh.capped_share = capped_share(mesh);
  if (options.repair && turn_over_if_inside_out(mesh)) {
    const std::size_t file = source.path().size() + 2;
    const std::string reported =
        (name.size() > file ? name.substr(file) : "all of it") + " is inside out and is turned over: its volume is negative";
    // An object with instances in several orientations is reported once.
    if (std::ranges::none_of(notes, [&](const Note& note) { return note.text == reported; })) notes.push_back({true, reported});
    if (turns_shells) turn_shells(mesh, prefix, notes);
  }
  return mesh;
}

}  // namespace lamina::load
