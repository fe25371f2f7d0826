#include <fmt/format.h>

#include <cmath>

#include "pipeline/run/extrude.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"
#include "pipeline/text/readable.h"
#include "stages/write/gcode/gcode.h"

namespace lamina::pipeline {

std::string extrude_summary_text(const Job& job, const ExtrudeSummary& s) {
  std::string text;
  const auto line = [&](std::string_view name, const std::string& value) { text += fmt::format("{:<10}{}\n", name, value); };
  for (std::size_t i = 0; i < s.parts.size(); ++i) {
    const PartSummary& part = s.parts[i];
    const Box& box = part.bounds;
    line(i == 0 ? "parts" : "",
         fmt::format("{}{}: {} triangles, {:.3f} x {:.3f} x {:.3f} mm at {:.3f}, {:.3f} mm", part.path,
                     part.copies > 1 ? fmt::format(" x {}", part.copies) : "", readable_count(part.triangles), mm(box.width()),
                     mm(box.depth()), mm(box.height()), mm(box.lo.x), mm(box.lo.y)));
    for (const Note& note : part.notes) line("", fmt::format("  {}{}", note.repair ? "repair: " : "", note.text));
  }
  line("machine", s.machine);
  line("layers", fmt::format("{}, {:.3f} mm high", readable_count(s.layers), s.height_mm));
  for (const auto& [heights, pores] : s.pores) {
    line("pores",
         fmt::format("{}{:.2f} mm long, {:.3f} mm wide (ratio {:.2f}), {:.2f} a mm2 of layer",
                     heights.empty() ? "" : heights + ": ", pores.length_mm, pores.width_mm, pores.aspect, pores.density_mm2));
  }
  if (job.dry_run) {
    line("dry run", "nothing was written");
  } else {
    line("beads", fmt::format("{} moves, {:.2f} m, {:.3f} cm3; {} travels, {:.2f} m", readable_count(s.totals.moves),
                              s.totals.bead_mm / 1000, s.totals.volume_mm3 / 1000, readable_count(s.totals.travels),
                              s.totals.travel_mm / 1000));
    if (s.segments.stretches > 0) {
      line("segments", fmt::format("{} lines, {} thick and {} thin stretches, {} points", readable_count(s.segments.lines),
                                   readable_count(s.segments.stretches - s.segments.thin), readable_count(s.segments.thin),
                                   readable_count(s.segments.points())));
    }
    if (s.porosity.solid_mm3 > 0) {
      line("porosity",
           fmt::format("{:.2f} % by what is extruded, {:.2f} % with elliptic beads, {:.2f} % by measured widths",
                       100 * s.porosity.by_extrusion(), 100 * s.porosity.by_ellipses(), 100 * s.porosity.by_widths()));
    }
    line("filament", fmt::format("{:.1f} mm, {:.2f} cm3, {:.2f} g", s.totals.filament_mm, s.filament_cm3, s.filament_g));
    line("printing", fmt::format("about {}", write::gcode::time_text(s.totals.seconds)));
    line("file", fmt::format("{} in {}", readable_bytes(s.bytes_written), s.output));
    line("time",
         fmt::format("{}: load {}, index {}, layers {} (threads: slice and fill {}, write {})",
                     readable_seconds(s.load_seconds + s.index_seconds + s.layer_seconds), readable_seconds(s.load_seconds),
                     readable_seconds(s.index_seconds), readable_seconds(s.layer_seconds), readable_seconds(s.plan_seconds),
                     readable_seconds(s.write_seconds)));
    line("memory",
         fmt::format("{} at most (layers in flight up to {} of {}, {} at once)", readable_bytes(s.peak_resident_bytes),
                     readable_bytes(s.peak_layer_bytes), readable_bytes(job.memory_bytes), s.most_in_flight));
  }
  for (const std::string& warning : s.warnings) line("warning", one_line(warning));
  return text;
}

std::string extrude_summary_json(const Job& job, const ExtrudeSummary& s) {
  std::string warnings, pores;
  for (const std::string& warning : s.warnings) warnings += (warnings.empty() ? "" : ",") + json_string(warning);
  for (const auto& [heights, p] : s.pores) {
    pores += fmt::format("{}{{\"heights\":{},\"length_mm\":{},\"width_mm\":{},\"aspect\":{},\"density_mm2\":{}}}",
                         pores.empty() ? "" : ",", json_string(heights), p.length_mm, p.width_mm, p.aspect, p.density_mm2);
  }
  const bool solid = s.porosity.solid_mm3 > 0;
  return fmt::format(
      "{{\"command\":\"extrude\",\"dry_run\":{},\"output\":{},\"machine\":{},\"layers\":{},\"height_mm\":{},\"triangles\":{},"
      "\"moves\":{},\"travels\":{},\"retractions\":{},\"stored_points\":{},\"bead_mm\":{},\"travel_mm\":{},\"volume_mm3\":{},"
      "\"filament_mm\":{},\"filament_g\":{},\"print_seconds\":{},"
      "\"segments\":{{\"lines\":{},\"pieces\":{},\"stretches\":{},\"thin\":{},\"points\":{},\"points_first_layer\":{}}},"
      "\"solid_mm3\":{},\"porosity\":{{\"by_extrusion\":{},\"by_ellipses\":{},\"by_widths\":{}}},\"pores\":[{}],"
      "\"bytes_written\":{},\"seconds\":{{\"load\":{},\"index\":{},\"layers\":{},\"plan_threads\":{},\"write_threads\":{}}},"
      "\"peak_layer_bytes\":{},\"peak_resident_bytes\":{},\"warnings\":[{}]}}\n",
      job.dry_run, json_string(s.output), json_string(s.machine), s.layers, s.height_mm, s.triangles, s.totals.moves,
      s.totals.travels, s.totals.retractions, s.points, s.totals.bead_mm, s.totals.travel_mm, s.totals.volume_mm3,
      s.totals.filament_mm, s.filament_g, s.totals.seconds, s.segments.lines, s.segments.pieces, s.segments.stretches,
      s.segments.thin, s.segments.points(), s.first_layer_points, s.porosity.solid_mm3, solid ? s.porosity.by_extrusion() : 0,
      solid ? s.porosity.by_ellipses() : 0, solid ? s.porosity.by_widths() : 0, pores, s.bytes_written, s.load_seconds,
      s.index_seconds, s.layer_seconds, s.plan_seconds, s.write_seconds, s.peak_layer_bytes, s.peak_resident_bytes, warnings);
}

}  // namespace lamina::pipeline
