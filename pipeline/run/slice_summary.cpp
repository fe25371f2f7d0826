#include <fmt/format.h>

#include "pipeline/plan/heights.h"
#include "pipeline/run/slice.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"
#include "pipeline/text/readable.h"

namespace lamina::pipeline {

std::string slice_summary_text(const Job& job, const SliceSummary& s) {
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
  line("layers",
       fmt::format("{} {}{}", readable_count(s.layers_total), heights_text(job),
                   !job.dry_run && s.layers != s.layers_total ? fmt::format("; {} sliced", readable_count(s.layers)) : ""));
  if (job.dry_run) {
    line("dry run", "nothing was written");
  } else {
    line("contours", fmt::format("{} with {} points, {:.3f} cm3; {} layers needed a union", readable_count(s.contours),
                                 readable_count(s.points), s.volume_mm3 / 1000, readable_count(s.united_layers)));
    if (s.paths > 0) line("filling", fmt::format("{} paths, {:.2f} m of bead", readable_count(s.paths), s.bead_mm / 1000));
    if (s.gaps_closed > 0 || s.open_chains > 0) {
      line("gaps", fmt::format("{} closed by straight stretches, the longest {:.6f} mm; {} chains left open",
                               readable_count(s.gaps_closed), s.largest_gap_mm, readable_count(s.open_chains)));
    }
    line("file", fmt::format("{} in {}", readable_bytes(s.bytes_written), s.output));
    line("time",
         fmt::format("{}: load {}, index {}, layers {} (threads: slice and fill {}, encode {})",
                     readable_seconds(s.load_seconds + s.index_seconds + s.layer_seconds), readable_seconds(s.load_seconds),
                     readable_seconds(s.index_seconds), readable_seconds(s.layer_seconds), readable_seconds(s.slice_seconds),
                     readable_seconds(s.encode_seconds)));
    line("memory", fmt::format("{} at most (index {}, layers in flight up to {} of {}, {} at once)",
                               readable_bytes(s.peak_resident_bytes), readable_bytes(s.index_bytes),
                               readable_bytes(s.peak_layer_bytes), readable_bytes(job.memory_bytes), s.most_in_flight));
  }
  for (const std::string& warning : s.warnings) line("warning", one_line(warning));
  return text;
}

std::string slice_summary_json(const Job& job, const SliceSummary& s) {
  std::string warnings;
  for (const std::string& warning : s.warnings) warnings += (warnings.empty() ? "" : ",") + json_string(warning);
  return fmt::format(
      "{{\"command\":\"slice\",\"dry_run\":{},\"output\":{},\"format\":{},\"layers_total\":{},\"layers\":{},"
      "\"triangles\":{},\"cuts\":{},\"contours\":{},\"points\":{},\"paths\":{},\"bead_mm\":{},\"volume_mm3\":{},"
      "\"united_layers\":{},\"gaps_closed\":{},\"largest_gap_mm\":{},\"open_chains\":{},\"emptied_layers\":{},\"bytes_written\":{},"
      "\"seconds\":{{\"load\":{},\"index\":{},\"layers\":{},\"slice_threads\":{},\"encode_threads\":{}}},"
      "\"index_bytes\":{},\"peak_layer_bytes\":{},\"peak_resident_bytes\":{},\"warnings\":[{}]}}\n",
      job.dry_run, json_string(s.output), json_string(job.slice.format), s.layers_total, s.layers, s.triangles, s.cuts,
      s.contours, s.points, s.paths, s.bead_mm, s.volume_mm3, s.united_layers, s.gaps_closed, s.largest_gap_mm, s.open_chains,
      s.emptied_layers, s.bytes_written, s.load_seconds, s.index_seconds, s.layer_seconds, s.slice_seconds, s.encode_seconds,
      s.index_bytes, s.peak_layer_bytes, s.peak_resident_bytes, warnings);
}

}  // namespace lamina::pipeline
