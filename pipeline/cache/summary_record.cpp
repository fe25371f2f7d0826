#include "pipeline/cache/summary_record.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <utility>
#include <vector>

namespace lamina::pipeline {
namespace {

/// Replaces whole names in a text.
using Renames = std::vector<std::pair<std::string, std::string>>;

bool is_of_name(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '.' || c == '/';
}

/// The text with each name that stands alone replaced, in one pass: a new name is not replaced again.
std::string renamed(const std::string& text, const Renames& renames) {
  std::string result;
  std::size_t at = 0;
  const auto match = [&](const std::pair<std::string, std::string>& rename) {
    const std::string& name = rename.first;
    if (text.compare(at, name.size(), name) != 0 || (at > 0 && is_of_name(text[at - 1]))) return false;
    const std::size_t end = at + name.size();
    return end == text.size() || !is_of_name(text[end]) ||
           (text[end] == '.' && (end + 1 == text.size() || text[end + 1] == ' '));
  };
  while (at < text.size()) {
    const auto found = std::ranges::find_if(renames, match);
    if (found == renames.end()) {
      result += text[at++];
    } else {
      result += found->second;
      at += found->first.size();
    }
  }
  return result;
}

Json renamed(const Json& value, const Renames& renames) {
  if (renames.empty()) return value;
  if (value.is_string()) return renamed(value.text(), renames);
  if (value.is_object()) {
    Json object = Json::object();
    for (const auto& [name, member] : value.members()) object[name] = renamed(member, renames);
    return object;
  }
  if (value.begin() == value.end()) return value;
  Json list = Json::array();
  for (const Json& element : value) list.push_back(renamed(element, renames));
  return list;
}

Json lines_json(const Summary::Lines& lines) {
  Json json = Json::array();
  for (const auto& [name, text] : lines) json.push_back(Json::array({name, text}));
  return json;
}

Summary::Lines lines_from(const Json& json) {
  Summary::Lines lines;
  for (const Json& line : json) lines.emplace_back(line.at(0).text(), line.at(1).text());
  return lines;
}

Json record_of(const PartSummary& part) {
  const Box& box = part.bounds;
  Json notes = Json::array();
  for (const Note& note : part.notes) notes.push_back(Json::array({note.repair, note.text}));
  return {{"path", part.path},
          {"copies", part.copies},
          {"triangles", part.triangles},
          {"fingerprint", part.fingerprint},
          {"bounds_nm", Json::array({box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z})},
          {"notes", notes}};
}

PartSummary part_of_record(const Json& json) {
  PartSummary part;
  part.path = json.at("path").text();
  json.at("copies").get_to(part.copies);
  json.at("triangles").get_to(part.triangles);
  json.at("fingerprint").get_to(part.fingerprint);
  const std::vector<Nm> bounds = json.at("bounds_nm").get<std::vector<Nm>>();
  if (bounds.size() != 6) throw JsonError("bounds_nm");
  part.bounds = Box{{bounds[0], bounds[1], bounds[2]}, {bounds[3], bounds[4], bounds[5]}};
  for (const Json& note : json.at("notes")) {
    Note& added = part.notes.emplace_back();
    note.at(0).get_to(added.repair);
    added.text = note.at(1).text();
  }
  return part;
}

Json record_of(const Warning& warning) {
  Json json{{"code", warning.code}, {"text", warning.text}, {"part", warning.part}};
  if (warning.layer) json["layer"] = *warning.layer;
  if (warning.z_mm) json["z_mm"] = *warning.z_mm;
  return json;
}

Warning warning_of_record(const Json& json) {
  Warning warning{json.at("code").text(), json.at("text").text(), json.at("part").text()};
  if (const Json* layer = json.find("layer")) warning.layer = layer->get<std::uint32_t>();
  if (const Json* z_mm = json.find("z_mm")) warning.z_mm = z_mm->get<double>();
  return warning;
}

/// Names of the recorded parts that differ now: paths, and file names, the longest first.
Renames renames_of(const Json& record, std::span<const std::string> paths) {
  const Json& parts = record.at("parts");
  if (parts.size() != paths.size()) throw JsonError("parts");
  Renames renames;
  const auto add = [&](const std::string& from, const std::string& to) {
    if (from != to && !from.empty()) renames.emplace_back(from, to);
  };
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const std::filesystem::path from = parts[i].at("path").text(), to = paths[i];
    add(from.string(), to.string());
    add(from.filename().string(), to.filename().string());
  }
  std::ranges::stable_sort(renames, [](const auto& a, const auto& b) { return a.first.size() > b.first.size(); });
  return renames;
}

}  // namespace

Json summary_record(const Summary& summary) {
  Json parts = Json::array(), warnings = Json::array();
  for (const PartSummary& part : summary.parts) parts.push_back(record_of(part));
  for (const Warning& warning : summary.warnings) warnings.push_back(record_of(warning));
  return {{"format", summary.format},
          {"machine", summary.machine},
          {"layer_text", summary.layer_text},
          {"height_mm", summary.height_mm},
          {"layers_total", summary.layers_total},
          {"triangles", summary.triangles},
          {"volume_mm3", summary.volume_mm3},
          {"bytes_written", summary.bytes_written},
          {"parts", parts},
          {"warnings", warnings},
          {"head", lines_json(summary.head)},
          {"results", lines_json(summary.results)},
          {"end", lines_json(summary.end)},
          {"more", summary.facts}};
}

Summary summary_of_record(const Json& record, std::span<const std::string> paths) {
  const Renames renames = renames_of(record, paths);
  const auto named = [&](std::string_view key) { return renamed(record.at(key), renames); };
  Summary summary;
  record.at("format").get_to(summary.format);
  record.at("machine").get_to(summary.machine);
  record.at("layer_text").get_to(summary.layer_text);
  record.at("height_mm").get_to(summary.height_mm);
  record.at("layers_total").get_to(summary.layers_total);
  record.at("triangles").get_to(summary.triangles);
  record.at("volume_mm3").get_to(summary.volume_mm3);
  record.at("bytes_written").get_to(summary.bytes_written);
  for (const Json& part : record.at("parts")) {
    PartSummary& added = summary.parts.emplace_back(part_of_record(part));
    added.path = paths[summary.parts.size() - 1];
  }
  for (const Json& warning : named("warnings")) summary.warnings.push_back(warning_of_record(warning));
  summary.head = lines_from(named("head"));
  summary.results = lines_from(named("results"));
  summary.end = lines_from(named("end"));
  summary.facts = named("more");
  return summary;
}

}  // namespace lamina::pipeline
