#include "pipeline/manifest/manifest_head.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "pipeline/manifest/possible.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/text_shape.h"

namespace lamina {
namespace {

constexpr std::pair<Product, std::string_view> kKinds[] = {
    {Product::kImages, "images"}, {Product::kContours, "contours"}, {Product::kMoves, "toolpaths"}};

std::string_view kind_name(Product product) {
  return std::ranges::find(kKinds, product, &std::pair<Product, std::string_view>::first)->second;
}

std::string text_of(const Json& json) { return json_text(json); }

Json point_json(const Point3& p) { return {p.x, p.y, p.z}; }
Point3 point_from(const Json& json) { return {json.at(0).get<Nm>(), json.at(1).get<Nm>(), json.at(2).get<Nm>()}; }

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
  json.at("path").get_to(part.path);
  json.at("copies").get_to(part.copies);
  json.at("triangles").get_to(part.triangles);
  part.fingerprint = std::stoull(json.at("fingerprint").get<std::string>(), nullptr, 16);
  part.bounds = {point_from(json.at("bounds_nm").at(0)), point_from(json.at("bounds_nm").at(1))};
  for (const Json& note : json.at("notes")) part.notes.push_back({note.at("repair").get<bool>(), note.at("text").text()});
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
  head.grid.x = axis_from(json.at("dpi").at(0), json.at("bed_nm").at(0).get<std::int64_t>());
  head.grid.y = axis_from(json.at("dpi").at(1), json.at("bed_nm").at(1).get<std::int64_t>());
  json.at("fill_rule").get_to(head.fill_rule);
  json.at("mirror").get_to(head.mirror);
  if (json.contains("materials")) {
    for (const Json& entry : json.at("materials"))
      head.materials.push_back({entry.at("name").text(), entry.at("vat").get<decltype(JobMaterial::vat)>()});
  }
  if (json.contains("most_drops")) json.at("most_drops").get_to(head.most_drops);
  if (json.contains("levels")) json.at("levels").get_to(head.levels);
  if (head.machine.empty()) return;
  json.at("dialect").get_to(head.dialect);
  json.at("program_extension").get_to(head.program_extension);
  head.program_start = hash_from(json.at("program_start_xxh3_128"));
  head.program_end = hash_from(json.at("program_end_xxh3_128"));
  if (json.contains("head_drops")) json.at("head_drops").get_to(head.head_drops);
  if (json.contains("sweep_drops")) json.at("sweep_drops").get_to(head.sweep_drops);
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
  const std::string& kind = json.at("kind").text();
  const auto found = std::ranges::find(kKinds, kind, &std::pair<Product, std::string_view>::second);
  if (found == std::end(kKinds)) throw std::invalid_argument(fmt::format("kind '{}' is none", kind));
  head.product = found->first;
  json.at("lamina").get_to(head.version);
  json.at("job").get_to(head.job_toml);
  json.at("format").get_to(head.format);
  json.at("extension").get_to(head.extension);
  json.at("file").get_to(head.file);
  json.at("layer_count").get_to(head.layer_count);
  json.at("range").at(0).get_to(head.first_layer);
  json.at("range").at(1).get_to(head.last_layer);
  for (const Json& part : json.at("parts")) head.parts.push_back(part_from(part));
  if (json.contains("machine")) {
    json.at("machine").get_to(head.machine);
    head.machine_profile = hash_from(json.at("machine_xxh3_128"));
  }
  if (head.product == Product::kImages) read_images(json, head);
  return head;
}

/// Null if it is not JSON. fraction  whether a number is not whole, as all of heads and tails are, or too large to be one
Json parsed(const std::string& text, bool& fraction) {
  try {
    Json json = parse_json(text);
    fraction = json.has_fraction();
    return json;
  } catch (const JsonError&) {
    return {};
  }
}

/// An object of a key a line, without its end.
std::string lines_of(const Json& json) {
  std::string text = "{\n";
  for (const auto& [key, value] : json.members()) text += fmt::format("{}: {},\n", text_of(key), text_of(value));
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
  if (!json.contains("manifest") || json.at("manifest") != kManifestVersion) {
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
      json.at("whole_file").at("bytes").get_to(file.bytes);
      file.hash = hash_from(json.at("whole_file").at("xxh3_128"));
    } catch (const std::exception&) {
      return false;
    }
  }
  const std::string whole = tail_text(head, file);
  return whole.substr(whole.find(head.file.empty() ? "]\n" : "],\n") + (head.file.empty() ? 2 : 3)) == text;
}

}  // namespace lamina
