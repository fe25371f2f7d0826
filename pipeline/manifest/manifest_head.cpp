#include "pipeline/manifest/manifest_head.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <stdexcept>

#include "stages/formats/image_format.h"
#include "stages/formats/slice_format.h"
#include "stages/program/dialect.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestName = 255, kLongestMaterial = 40;  // bytes
constexpr std::int64_t kMostMicroseconds = 1'000'000'000'000;     // of a layer, as a replay counts them
constexpr std::uint32_t kMostDrops = 64;                          // of a pixel
constexpr std::int64_t kMostDots = 25'400, kMostSpan = 1'000'000'000'000, kLeastPixel = 1000;

/// Of the letters that read::check_material allows.
bool is_material(std::string_view name) {
  return !name.empty() && name.size() <= kLongestMaterial && std::ranges::all_of(name, [](unsigned char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '-' || c == '_';
  });
}

std::string no_such(std::string_view what, std::string_view value) {
  return fmt::format("\"{}\" is {}, which lamina does not write", what, one_line(value.substr(0, 80)));
}

/// The name of a file in a folder: no folder in it, and not the folder itself or the one above.
bool is_file_name(std::string_view name) {
  return !name.empty() && name.size() <= kLongestName && name != "." && name != ".." &&
         name.find_first_of(std::string_view("/\0", 2)) == std::string_view::npos;
}

/// The grid's axis. errors  throws std::invalid_argument for one that no bed has
PixelAxis possible_axis(std::int64_t dots, std::int64_t length, std::int64_t span) {
  if (dots < 1 || dots > kMostDots || span < 1 || span > kMostSpan || span / dots < kLeastPixel || length < 1 ||
      length > kNmReach) {
    throw std::invalid_argument("its grid is none of a bed");
  }
  return PixelAxis(dots, length, span);
}

std::string fault_of_images(const ManifestHead& head) {
  const auto extension = write::extension_of(head.format);
  if (!extension) return no_such("format", head.format);
  if (head.extension != *extension) return no_such("extension", head.extension);
  if (!head.file.empty()) return no_such("file", head.file);
  std::set<std::string_view> names;
  for (const JobMaterial& material : head.materials) {
    if (!is_material(material.name) || !names.insert(material.name).second) return no_such("materials", material.name);
  }
  constexpr std::size_t kMostVats = 2;  // several drops are of a machine, whose vats the materials are in
  if (head.most_drops > kMostDrops || (head.drops_of_materials() && head.materials.size() > kMostVats)) {
    return no_such("most_drops", fmt::format("{}", head.most_drops));
  }
  const bool grey = write::find_level_format(head.format) != nullptr;
  const bool right = head.levels == 2 || head.levels == 4 || head.levels == 16;
  const bool drops = head.most_drops > 0;  // also as grey, of a job with a machine
  if (head.levels > 0 ? !right || (!grey && !drops) : grey && !drops) {
    return no_such("levels", fmt::format("{}", head.levels));
  }
  if (grey && (drops == head.machine.empty() || (!drops && !head.materials.empty()))) return no_such("format", head.format);
  constexpr std::uint32_t kMostHeadDrops = 15;
  if (head.head_drops > kMostHeadDrops || head.sweep_drops < 1 || head.sweep_drops > head.head_drops) {
    return no_such("sweep_drops", fmt::format("{}", head.sweep_drops));
  }
  if (head.machine.empty()) return {};
  for (const JobMaterial& material : head.materials) {
    if (material.vat > 1) return no_such("vat", fmt::format("{}", material.vat));
  }
  const auto* dialect = write::find_dialect(head.dialect);
  if (dialect == nullptr) return no_such("dialect", head.dialect);
  return head.program_extension == dialect->extension ? "" : no_such("program_extension", head.program_extension);
}

std::string fault_of_contours(const ManifestHead& head) {
  const auto* slice = write::find_slice_format(head.format);
  if (slice == nullptr) return no_such("format", head.format);
  const bool layer_files = head.file.empty() && !slice->extension.empty();
  if (head.extension != (layer_files && slice->layer_files ? slice->extension : ""))
    return no_such("extension", head.extension);
  if (head.file.empty()) return slice->layer_files || slice->extension.empty() ? "" : no_such("file", "absent");
  const bool named = is_file_name(head.file) && !slice->extension.empty() && head.file.ends_with(slice->extension);
  return named ? "" : no_such("file", head.file);
}

std::string fault_of_moves(const ManifestHead& head) {
  if (head.format != "gcode" && head.format != "sml") return no_such("format", head.format);
  if (!head.extension.empty()) return no_such("extension", head.extension);
  return is_file_name(head.file) ? "" : no_such("file", head.file);
}

/// Empty, or what no job of this version has. The extension is its format's, that of programs their dialect's, materials
/// have names that files can have, the grid is one of a bed.
std::string what_is_impossible(const ManifestHead& head) {
  for (const PartSummary& part : head.parts) {
    if (!part.path.empty() && !is_file_name(part.path)) return no_such("path", part.path);
  }
  switch (head.product) {
    case Product::kImages: return fault_of_images(head);
    case Product::kContours: return fault_of_contours(head);
    case Product::kMoves: break;
  }
  return fault_of_moves(head);
}

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

std::string what_is_impossible(const Layer& layer) {
  const bool possible = layer.bottom >= 0 && layer.thickness > 0 && std::int64_t{layer.bottom} + layer.thickness <= kNmReach;
  return possible ? "" : fmt::format("lies at {} nm and is {} nm thick", layer.bottom, layer.thickness);
}

std::string what_is_impossible(const ProgramRecord& program) {
  if (program.added_sweeps > program.sweeps || std::abs(program.added_microseconds) > program.microseconds) {
    return fmt::format("has {} added sweeps in {} microseconds", program.added_sweeps, program.added_microseconds);
  }
  const bool possible = program.microseconds >= 0 && program.microseconds <= kMostMicroseconds;
  return possible ? "" : fmt::format("takes {} microseconds", program.microseconds);
}

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
