#include "pipeline/manifest/manifest_head.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "pipeline/manifest/possible.h"
#include "stages/support/text/text_shape.h"

namespace lamina {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::pair<Product, std::string_view> kKinds[] = {
    {Product::kImages, "images"}, {Product::kContours, "contours"}, {Product::kMoves, "toolpaths"}};

std::string_view kind_name(Product product) {
  return std::ranges::find(kKinds, product, &std::pair<Product, std::string_view>::first)->second;
}

std::string text_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

Json point_json(const Point3& p) { return {p.x, p.y, p.z}; }
Point3 point_from(const Json& json) { return {json.at(0), json.at(1), json.at(2)}; }

Json part_json(const PartSummary& part) {
  Json notes = Json::array();
  for (const Note& note : part.notes) notes.push_back({{"repair", note.repair}, {"text", note.text}});
  return {{"path", std::filesystem::path(part.path).filename().string()},
          {"copies", part.copies},
          {"triangles", part.triangles},
          {"fingerprint", fmt::format("{:016x}", part.fingerprint)},
          {"bounds_nm", {point_json(part.bounds.lo), point_json(part.bounds.hi)}},
          {"notes", notes}};
}

PartSummary part_from(const Json& json) {
  PartSummary part;
  part.path = json.at("path");
  part.copies = json.at("copies");
  part.triangles = json.at("triangles");
  part.fingerprint = std::stoull(json.at("fingerprint").get<std::string>(), nullptr, 16);
  part.bounds = {point_from(json.at("bounds_nm").at(0)), point_from(json.at("bounds_nm").at(1))};
  for (const Json& note : json.at("notes")) part.notes.push_back({note.at("repair"), note.at("text")});
  return part;
}

/// Whole dpi as a number; another grid as the dots that a span of nm holds.
Json dots_json(const PixelAxis& axis) {
  if (axis.span == kNmPerInch) return axis.dots;
  return fmt::format("{} in {} nm", axis.dots, axis.span);
}

PixelAxis axis_from(const Json& dots, std::int64_t length) {
  if (!dots.is_string()) return possible_axis(dots.get<std::int64_t>(), length, kNmPerInch);
  long long in_span = 1, span = kNmPerInch;
  std::sscanf(dots.get<std::string>().c_str(), "%lld in %lld nm", &in_span, &span);
  return possible_axis(in_span, length, span);
}

Hash128 hash_from(const Json& json) {
  Hash128 hash;
  if (!read_hex(json.get<std::string>(), hash)) throw std::invalid_argument("a hash is none");
  return hash;
}

void add_images(const ManifestHead& head, Json& json) {
  json["bed_nm"] = {head.grid.x.length, head.grid.y.length};
  json["dpi"] = {dots_json(head.grid.x), dots_json(head.grid.y)};
  json["columns"] = head.grid.columns();
  json["rows"] = head.grid.rows();
  json["fill_rule"] = head.fill_rule;
  json["mirror"] = head.mirror;
  if (!head.materials.empty()) {
    Json& materials = json["materials"] = Json::array();
    for (const JobMaterial& material : head.materials) materials.push_back({{"name", material.name}, {"vat", material.vat}});
  }
  if (head.most_drops > 0) json["most_drops"] = head.most_drops;
  if (head.levels > 0) json["levels"] = head.levels;
  if (head.machine.empty()) return;
  json["dialect"] = head.dialect;
  json["program_extension"] = head.program_extension;
  json["program_start_xxh3_128"] = hex(head.program_start);
  json["program_end_xxh3_128"] = hex(head.program_end);
  if (head.head_drops <= 1) return;
  json["head_drops"] = head.head_drops;
  json["sweep_drops"] = head.sweep_drops;
}

void read_images(const Json& json, ManifestHead& head) {
  head.grid.x = axis_from(json.at("dpi").at(0), json.at("bed_nm").at(0));
  head.grid.y = axis_from(json.at("dpi").at(1), json.at("bed_nm").at(1));
  head.fill_rule = json.at("fill_rule");
  head.mirror = json.at("mirror");
  if (json.contains("materials")) {
    for (const Json& entry : json.at("materials")) head.materials.push_back({entry.at("name"), entry.at("vat")});
  }
  if (json.contains("most_drops")) head.most_drops = json.at("most_drops");
  if (json.contains("levels")) head.levels = json.at("levels");
  if (head.machine.empty()) return;
  head.dialect = json.at("dialect");
  head.program_extension = json.at("program_extension");
  head.program_start = hash_from(json.at("program_start_xxh3_128"));
  head.program_end = hash_from(json.at("program_end_xxh3_128"));
  if (json.contains("head_drops")) head.head_drops = json.at("head_drops");
  if (json.contains("sweep_drops")) head.sweep_drops = json.at("sweep_drops");
}

Json lasting_json(const ManifestHead& head) {
  Json json;
  json["lamina"] = head.version;
  json["manifest"] = kManifestVersion;
  json["kind"] = kind_name(head.product);
  json["job"] = head.job_toml;
  json["format"] = head.format;
  json["extension"] = head.extension;
  json["file"] = head.file;
  json["layer_count"] = head.layer_count;
  json["parts"] = Json::array();
  for (const PartSummary& part : head.parts) json["parts"].push_back(part_json(part));
  if (!head.machine.empty()) {
    json["machine"] = head.machine;
    json["machine_xxh3_128"] = hex(head.machine_profile);
  }
  if (head.product == Product::kImages) add_images(head, json);
  return json;
}

/// Throws where something is missing or of another type.
ManifestHead head_from(const Json& json) {
  ManifestHead head;
  const std::string kind = json.at("kind");
  const auto found = std::ranges::find(kKinds, kind, &std::pair<Product, std::string_view>::second);
  if (found == std::end(kKinds)) throw std::invalid_argument(fmt::format("kind '{}' is none", kind));
  head.product = found->first;
  head.version = json.at("lamina");
  head.job_toml = json.at("job");
  head.format = json.at("format");
  head.extension = json.at("extension");
  head.file = json.at("file");
  head.layer_count = json.at("layer_count");
  head.first_layer = json.at("range").at(0);
  head.last_layer = json.at("range").at(1);
  for (const Json& part : json.at("parts")) head.parts.push_back(part_from(part));
  if (json.contains("machine")) {
    head.machine = json.at("machine");
    head.machine_profile = hash_from(json.at("machine_xxh3_128"));
  }
  if (head.product == Product::kImages) read_images(json, head);
  return head;
}

/// fraction  whether a number is none of the whole ones, of which heads and tails consist, or too large to be one
Json parsed(const std::string& text, bool& fraction) {
  fraction = false;
  const auto look = [&](int, Json::parse_event_t, const Json& value) {
    fraction = fraction || value.is_number_float();
    return true;
  };
  return Json::parse(text, look, false);
}

/// An object of a key a line, without its end.
std::string lines_of(const Json& json) {
  std::string text = "{\n";
  for (const auto& [key, value] : json.items()) text += fmt::format("{}: {},\n", text_of(key), text_of(value));
  return text;
}

}  // namespace

std::string lasting_text(const ManifestHead& head) { return lines_of(lasting_json(head)); }

std::string head_text(const ManifestHead& head) {
  Json json = lasting_json(head);
  json["id"] = hex(head.id());
  json["range"] = {head.first_layer, head.last_layer};
  return lines_of(json) + text_of("layers") + ": [";
}

std::string tail_text(const ManifestHead& head, const FileDigest& file) {
  if (head.file.empty()) return "\n]\n}\n";
  const Json json{{"bytes", file.bytes}, {"xxh3_128", hex(file.hash)}};
  return "\n],\n" + text_of("whole_file") + ": " + text_of(json) + "\n}\n";
}

Result<ManifestHead> read_head(const std::string& text) {
  const auto wrong = [](const std::string& what) { return Error{Fault::kVerification, what}; };
  if (!json_nests_within(text)) return wrong("is no manifest of lamina");
  bool fraction = false;
  const Json json = parsed(text + "]}", fraction);
  if (!json.is_object()) return wrong("is no manifest of lamina");
  if (!json.contains("manifest") || json["manifest"] != kManifestVersion) {
    if (!json.contains("lamina")) return wrong("is no manifest of lamina");
    return wrong(
        fmt::format("is of another version of lamina, whose manifests differ from those of this one; read it with that "
                    "version, or plan the job again with --overwrite"));
  }
  if (fraction) return wrong("the head has a number that is not whole; it was changed");
  ManifestHead head;
  try {
    head = head_from(json);
  } catch (const std::exception& error) {
    return wrong(error.what());
  }
  // Written again it has to be the same text: then nothing in it was changed, its id holds, and all of it was read.
  if (head_text(head) != text) return wrong("the head is not what was written; it was changed");
  if (head.first_layer > head.last_layer || head.last_layer > head.layer_count) return wrong("the range is no range");
  if (std::string what = what_is_impossible(head); !what.empty()) return wrong(what);
  return head;
}

bool read_tail(const ManifestHead& head, const std::string& text, FileDigest& file) {
  if (!head.file.empty()) {
    if (!json_nests_within(text)) return false;
    bool fraction = false;
    const Json json = parsed("{" + text.substr(0, text.find('\n')) + "}", fraction);
    if (!json.is_object() || fraction || !json.contains("whole_file")) return false;
    try {
      file.bytes = json.at("whole_file").at("bytes");
      file.hash = hash_from(json.at("whole_file").at("xxh3_128"));
    } catch (const std::exception&) {
      return false;
    }
  }
  const std::string whole = tail_text(head, file);
  return whole.substr(whole.find(head.file.empty() ? "]\n" : "],\n") + (head.file.empty() ? 2 : 3)) == text;
}

}  // namespace lamina
