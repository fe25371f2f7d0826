#include "pipeline/report/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "pipeline/report/timing.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

double rate(double amount, double seconds) { return seconds > 0 ? amount / seconds : 0; }

Json point_json(const Point3& p) { return {mm(p.x), mm(p.y), mm(p.z)}; }

using NamedText = std::pair<std::string, std::string>;

std::string layers_line(const Summary& s) {
  std::string text = fmt::format("{} {}", readable_count(s.layers_total), s.layer_text);
  if (!s.dry_run && s.layers_planned != s.layers_total) text += fmt::format("; {} planned", readable_count(s.layers_planned));
  if (s.layers_kept > 0) text += fmt::format(", {} kept", readable_count(s.layers_kept));
  return text;
}

void add_costs(const Summary& s, std::vector<NamedText>& lines) {
  std::string steps;
  for (const auto& [name, seconds] : s.step_seconds) {
    steps += fmt::format("{}{} {}", steps.empty() ? "" : ", ", name, readable_seconds(seconds));
  }
  lines.emplace_back("time", fmt::format("{}: load {}, index {}, layers {} (threads: {})",
                                         readable_seconds(s.load_seconds + s.index_seconds + s.layer_seconds),
                                         readable_seconds(s.load_seconds), readable_seconds(s.index_seconds),
                                         readable_seconds(s.layer_seconds), steps));
  lines.emplace_back(
      "memory", fmt::format("{} at most (mesh {}, index {}; reserved for layers {} of {}, {} at once)",
                            readable_bytes(s.peak_resident_bytes), readable_bytes(s.mesh_bytes), readable_bytes(s.index_bytes),
                            readable_bytes(s.peak_layer_bytes), readable_bytes(s.memory_budget_bytes), s.max_layers_in_flight));
  if (s.oversized_layers > 0) {
    lines.emplace_back(
        "", fmt::format("{} layers ran alone: each needs more than --memory by itself", readable_count(s.oversized_layers)));
  }
}

void add_dry_run(const Summary& s, std::vector<NamedText>& lines) {
  lines.emplace_back("memory", fmt::format("mesh {}, index {}, a layer needs up to {}", readable_bytes(s.mesh_bytes),
                                           readable_bytes(s.index_bytes), readable_bytes(s.peak_layer_bytes)));
  std::string time = fmt::format("load {}, index {}", readable_seconds(s.load_seconds), readable_seconds(s.index_seconds));
  if (s.estimated_layer_seconds)
    time += fmt::format("; layers about {} on one processor", readable_seconds(*s.estimated_layer_seconds));
  lines.emplace_back("time", time);
  if (!s.estimate_text.empty()) lines.emplace_back("files", s.estimate_text);
  lines.emplace_back("dry run", "nothing was written");
}

}  // namespace

namespace {

/// Of jobs with many parts: a line for each file, and one for each kind of note, of all its parts.
Summary::Lines file_lines(const std::vector<PartSummary>& parts) {
  struct FileParts {
    const PartSummary* first;
    std::uint64_t copies = 0;
    std::vector<std::string> repairs = {};
    std::size_t noted = 0;  // parts with other notes
    std::string note = {};  // the first of them
  };
  std::vector<FileParts> files;
  std::map<std::string_view, std::size_t> number;
  for (const PartSummary& part : parts) {
    const auto [known, fresh] = number.try_emplace(part.path, files.size());
    if (fresh) files.push_back({&part});
    FileParts& file = files[known->second];
    file.copies += part.copies;
    bool other = false;
    for (const Note& note : part.notes) {
      if (!note.repair && file.note.empty()) file.note = note.text;
      other = other || !note.repair;
      if (note.repair && std::ranges::find(file.repairs, note.text) == file.repairs.end()) file.repairs.push_back(note.text);
    }
    file.noted += other;
  }
  Summary::Lines lines;
  for (const FileParts& file : files) {
    lines.emplace_back(lines.empty() ? "parts" : "",
                       fmt::format("{} x {}{}", one_line(file.first->path), file.copies,
                                   file.first->triangles == 0 ? std::string(": images")
                                                              : ": " + readable_count(file.first->triangles) + " triangles"));
    for (const std::string& repair : file.repairs) lines.emplace_back("", "  repair: " + one_line(repair));
    if (file.noted > 0) {
      const std::string more = file.noted > 1 ? fmt::format("; {} more have notes, see --json", file.noted - 1) : "";
      lines.emplace_back("", "  " + one_line(file.note) + more);
    }
  }
  return lines;
}

}  // namespace

Summary::Lines part_lines(const std::vector<PartSummary>& parts) {
  constexpr std::size_t kListed = 20;
  if (parts.size() > kListed) return file_lines(parts);
  Summary::Lines lines;
  for (const PartSummary& part : parts) {
    const Box& box = part.bounds;
    lines.emplace_back(&part == &parts.front() ? "parts" : "",
                       fmt::format("{}{}: {}, {:.3f} x {:.3f} x {:.3f} mm at {:.3f}, {:.3f} mm", one_line(part.path),
                                   part.copies > 1 ? fmt::format(" x {}", part.copies) : "",
                                   part.triangles == 0 ? "images" : readable_count(part.triangles) + " triangles",
                                   mm(box.width()), mm(box.depth()), mm(box.height()), mm(box.lo.x), mm(box.lo.y)));
    for (const Note& note : part.notes) {
      lines.emplace_back("", fmt::format("  {}{}", note.repair ? "repair: " : "", one_line(note.text)));
    }
  }
  return lines;
}

Json part_json(const PartSummary& part) {
  Json notes = Json::array();
  for (const Note& note : part.notes) notes.push_back({{"repair", note.repair}, {"text", note.text}});
  return {{"path", part.path},
          {"copies", part.copies},
          {"triangles", part.triangles},
          {"bounds_mm", Json{{"lo", point_json(part.bounds.lo)}, {"hi", point_json(part.bounds.hi)}}},
          {"notes", notes}};
}

Json warnings_json(const std::vector<Warning>& warnings) {
  Json all = Json::array();
  for (const Warning& warning : warnings) {
    Json& json = all.emplace_back(Json{{"code", warning.code}, {"text", warning.text}});
    if (!warning.part.empty()) json["part"] = warning.part;
    if (warning.layer) json["layer"] = *warning.layer;
    if (warning.z_mm) json["z_mm"] = *warning.z_mm;
  }
  return all;
}

std::string text_of(const Summary::Lines& lines) {
  std::string text;
  for (const auto& [name, what] : lines) text += fmt::format("{:<10}{}\n", name, what);
  return text;
}

std::string_view command_name(Product product) {
  constexpr std::string_view kNames[] = {"jet", "slice", "extrude"};
  return kNames[static_cast<std::size_t>(product)];
}

std::string Summary::text() const {
  Lines lines = part_lines(parts);
  if (!machine.empty()) lines.emplace_back("machine", machine);
  lines.insert(lines.end(), head.begin(), head.end());
  lines.emplace_back("layers", layers_line(*this));
  if (!dry_run || layers_planned > 0) lines.insert(lines.end(), results.begin(), results.end());
  if (dry_run) {
    add_dry_run(*this, lines);
  } else {
    lines.emplace_back(product == Product::kImages ? "files" : "file",
                       fmt::format("{} in {}", readable_bytes(bytes_written), one_line(output)));
    add_costs(*this, lines);
  }
  if (timing) {
    const Lines timed = timing_lines(*timing);
    lines.insert(lines.end(), timed.begin(), timed.end());
  }
  lines.insert(lines.end(), end.begin(), end.end());
  for (const Warning& warning : warnings) lines.emplace_back("warning", one_line(warning.text));
  return text_of(lines);
}

std::string Summary::json() const {
  Json threads = Json::object(), part_list = Json::array();
  for (const auto& [name, value] : step_seconds) threads[std::string(name)] = value;
  for (const PartSummary& part : parts) part_list.push_back(part_json(part));
  Json all{{"command", command_name(product)},
           {"dry_run", dry_run},
           {"output", output},
           {"format", format},
           {"machine", machine},
           {"height_mm", height_mm},
           {"layers_total", layers_total},
           {"layers_planned", layers_planned},
           {"layers_kept", layers_kept},
           {"triangles", triangles},
           {"volume_mm3", volume_mm3},
           {"bytes_written", bytes_written},
           {"seconds", {{"load", load_seconds}, {"index", index_seconds}, {"layers", layer_seconds}, {"threads", threads}}},
           {"layers_per_second", rate(layers_planned, layer_seconds)},
           {"mesh_bytes", mesh_bytes},
           {"index_bytes", index_bytes},
           {"peak_layer_bytes", peak_layer_bytes},
           {"memory_budget_bytes", memory_budget_bytes},
           {"peak_resident_bytes", peak_resident_bytes},
           {"max_layers_in_flight", max_layers_in_flight},
           {"oversized_layers", oversized_layers},
           {"parts", part_list},
           {"warnings", warnings_json(warnings)}};
  if (estimated_layer_seconds) all["seconds"]["layers_estimate"] = *estimated_layer_seconds;
  if (timing) all["timing"] = timing_json(*timing);
  all.update(facts);
  return json_line(all);
}

}  // namespace lamina::pipeline
