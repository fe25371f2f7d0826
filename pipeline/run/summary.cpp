#include "pipeline/run/summary.h"
#include "pipeline/text/readable.h"

#include "pipeline/plan/heights.h"

#include <fmt/format.h>

#include <vector>

#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

double rate(double amount, double seconds) { return seconds > 0 ? amount / seconds : 0; }

double pixels_planned(const JetSummary& s) { return static_cast<double>(s.columns) * s.rows * s.layers_planned; }

double porosity(const JetSummary& s) { return 1 - static_cast<double>(s.bead_pixels) / static_cast<double>(s.solid_pixels); }

std::string part_json(const PartSummary& part) {
  std::string notes;
  for (const Note& note : part.notes) {
    notes += fmt::format("{}{{\"repair\":{},\"text\":{}}}", notes.empty() ? "" : ",", note.repair, json_string(note.text));
  }
  const auto point = [](const Point3& p) { return fmt::format("[{},{},{}]", mm(p.x), mm(p.y), mm(p.z)); };
  return fmt::format("{{\"path\":{},\"copies\":{},\"triangles\":{},\"bounds_mm\":[{},{}],\"notes\":[{}]}}",
                     json_string(part.path), part.copies, part.triangles, point(part.bounds.lo), point(part.bounds.hi), notes);
}

}  // namespace

std::string summary_text(const Job& job, const JetSummary& s) {
  std::string text;
  const auto line = [&](std::string_view name, const std::string& value) { text += fmt::format("{:<10}{}\n", name, value); };
  for (std::size_t i = 0; i < s.parts.size(); ++i) {
    const PartSummary& part = s.parts[i];
    const Box& box = part.bounds;
    line(i == 0 ? "parts" : "",
         fmt::format("{}{}: {} triangles, {:.3f} x {:.3f} x {:.3f} mm at {:.3f}, {:.3f} mm", one_line(part.path),
                     part.copies > 1 ? fmt::format(" x {}", part.copies) : "", readable_count(part.triangles), mm(box.width()),
                     mm(box.depth()), mm(box.height()), mm(box.lo.x), mm(box.lo.y)));
    for (const Note& note : part.notes) line("", fmt::format("  {}{}", note.repair ? "repair: " : "", one_line(note.text)));
  }
  line("image", fmt::format("{} x {} pixels of {:g} x {:g} dpi on {} x {} mm, {}", s.columns, s.rows, grid_of(job).x.dpi(),
                            grid_of(job).y.dpi(), number_text(job.bed_mm[0]), number_text(job.bed_mm[1]), job.format));
  std::string layers = fmt::format("{} {}", readable_count(s.layers_total), heights_text(job));
  if (!job.dry_run && s.layers_planned != s.layers_total)
    layers += fmt::format("; {} planned", readable_count(s.layers_planned));
  if (s.layers_kept > 0) layers += fmt::format(", {} kept", readable_count(s.layers_kept));
  line("layers", layers);
  if (job.dry_run) {
    line("memory", fmt::format("mesh {}, index {}, a layer needs up to {}", readable_bytes(s.mesh_bytes),
                               readable_bytes(s.index_bytes), readable_bytes(s.peak_layer_bytes)));
    line("time", fmt::format("load {}, index {}", readable_seconds(s.seconds.load), readable_seconds(s.seconds.index)));
    line("dry run", "nothing was written");
  } else {
    line("pixels",
         fmt::format("{} set, {:.3f} cm3 of binder-filled volume", readable_count(s.set_pixels), s.set_volume_mm3 / 1000));
    if (s.solid_pixels > 0)
      line("porosity",
           fmt::format("{:.2f} % of the parts' {} pixels are left empty", 100 * porosity(s), readable_count(s.solid_pixels)));
    for (const auto& [material, pixels] : s.materials) line("", fmt::format("{} of {}", readable_count(pixels), material));
    line("files", fmt::format("{} in {}", readable_bytes(s.bytes_written), one_line(s.directory)));
    line("time",
         fmt::format("{}: load {}, index {}, layers {} (threads: raster {}, encode {}, write {})",
                     readable_seconds(s.seconds.load + s.seconds.index + s.seconds.layers), readable_seconds(s.seconds.load),
                     readable_seconds(s.seconds.index), readable_seconds(s.seconds.layers), readable_seconds(s.seconds.raster),
                     readable_seconds(s.seconds.encode), readable_seconds(s.seconds.write)));
    line("rate", fmt::format("{:.2f} Gpx/s, {:.1f} layers/s", rate(pixels_planned(s), s.seconds.layers) / 1e9,
                             rate(s.layers_planned, s.seconds.layers)));
    line("memory",
         fmt::format("{} at most (mesh {}, index {}, layers in flight up to {} of {}, {} at once)",
                     readable_bytes(s.peak_resident_bytes), readable_bytes(s.mesh_bytes), readable_bytes(s.index_bytes),
                     readable_bytes(s.peak_layer_bytes), readable_bytes(job.memory_bytes), s.most_layers_in_flight));
  }
  if (s.moved_pixels > 0)
    line("blocked", fmt::format("{} pixels of blocked nozzles are fired by their neighbours", readable_count(s.moved_pixels)));
  if (s.lost_pixels > 0) {
    line("warning",
         fmt::format("{} pixels of blocked nozzles are not fired at all; head.blocked_rule = \"second-pass\" fires them",
                     readable_count(s.lost_pixels)));
  }
  if (s.capped_rows > 0)
    line("repaired", fmt::format("{} rows are closed only thanks to repair", readable_count(s.capped_rows)));
  for (const std::string& warning : s.warnings) line("warning", one_line(warning));
  return text;
}

std::string summary_json(const Job& job, const JetSummary& s) {
  std::vector<std::string> parts, warnings;
  for (const PartSummary& part : s.parts) parts.push_back(part_json(part));
  for (const std::string& warning : s.warnings) warnings.push_back(json_string(warning));
  std::string text = fmt::format(
      "{{\"command\":\"jet\",\"dry_run\":{},\"directory\":{},\"format\":{},\"columns\":{},\"rows\":{},\"dpi\":[{},{}],"
      "\"layers_total\":{},\"layers_planned\":{},\"layers_kept\":{},\"triangles\":{},\"set_pixels\":{},"
      "\"set_volume_mm3\":{},\"bytes_written\":{},\"capped_rows\":{},",
      job.dry_run, json_string(s.directory), json_string(job.format), s.columns, s.rows, grid_of(job).x.dpi(),
      grid_of(job).y.dpi(), s.layers_total, s.layers_planned, s.layers_kept, s.triangles, s.set_pixels, s.set_volume_mm3,
      s.bytes_written, s.capped_rows);
  if (s.solid_pixels > 0)
    text += fmt::format("\"solid_pixels\":{},\"bead_pixels\":{},\"porosity\":{},", s.solid_pixels, s.bead_pixels, porosity(s));
  if (job.machine.resolved) text += fmt::format("\"moved_pixels\":{},\"lost_pixels\":{},", s.moved_pixels, s.lost_pixels);
  if (!s.materials.empty()) {
    std::string materials;
    for (const auto& [material, pixels] : s.materials) {
      materials +=
          fmt::format("{}{{\"name\":{},\"set_pixels\":{}}}", materials.empty() ? "" : ",", json_string(material), pixels);
    }
    text += fmt::format("\"materials\":[{}],", materials);
  }
  text += fmt::format(
      "\"seconds\":{{\"load\":{},\"index\":{},\"layers\":{},\"raster_threads\":{},\"encode_threads\":{},"
      "\"write_threads\":{}}},\"pixels_per_second\":{},\"layers_per_second\":{},",
      s.seconds.load, s.seconds.index, s.seconds.layers, s.seconds.raster, s.seconds.encode, s.seconds.write,
      rate(pixels_planned(s), s.seconds.layers), rate(s.layers_planned, s.seconds.layers));
  text += fmt::format(
      "\"mesh_bytes\":{},\"index_bytes\":{},\"peak_layer_bytes\":{},\"memory_budget_bytes\":{},\"peak_resident_bytes\":{},"
      "\"most_layers_in_flight\":{},\"parts\":[{}],\"warnings\":[{}]}}\n",
      s.mesh_bytes, s.index_bytes, s.peak_layer_bytes, job.memory_bytes, s.peak_resident_bytes, s.most_layers_in_flight,
      fmt::join(parts, ","), fmt::join(warnings, ","));
  return text;
}

}  // namespace lamina::pipeline
