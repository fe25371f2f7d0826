#include "pipeline/manifest/manifest_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <stdexcept>

#include "stages/formats/image_format.h"
#include "stages/formats/slice_format.h"
#include "stages/program/dialect.h"
#include "stages/support/io/compressed.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestName = 255, kLongestMaterial = 40;  // bytes
constexpr std::int64_t kMaxMicroseconds = 1'000'000'000'000;      // of a layer, as a replay counts them
constexpr std::uint32_t kMaxDrops = 64;                           // of a pixel
constexpr std::int64_t kMinPixel = 1000;                          // nm

/// Of the letters that pipeline::check_material allows.
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
  if (dots < 1 || dots > kMaxDots || span < 1 || span > kMaxSpan || span / dots < kMinPixel || length < 1 ||
      length > kNmReach) {
    throw std::invalid_argument("its grid has an impossible size or resolution");
  }
  return PixelAxis(dots, length, span);
}

std::string fault_of_images(const ManifestHead& head) {
  const auto extension = formats::extension_of(head.format);
  if (!extension) return no_such("format", head.format);
  if (head.extension != *extension) return no_such("extension", head.extension);
  if (!head.file.empty()) return no_such("file", head.file);
  std::set<std::string_view> names;
  for (const JobMaterial& material : head.materials) {
    if (!is_material(material.name) || !names.insert(material.name).second) return no_such("materials", material.name);
  }
  constexpr std::size_t kMaxVats = 2;  // several drops are of a machine, whose vats the materials are in
  if (head.max_drops > kMaxDrops || (head.drops_of_materials() && head.materials.size() > kMaxVats)) {
    return no_such("max_drops", fmt::format("{}", head.max_drops));
  }
  const bool grey = formats::find_level_format(head.format) != nullptr;
  const bool right = head.levels == 2 || head.levels == 4 || head.levels == 16;
  const bool drops = head.max_drops > 0;  // also as grey, of a job with a machine
  if (head.levels > 0 ? !right || (!grey && !drops) : grey && !drops) {
    return no_such("levels", fmt::format("{}", head.levels));
  }
  if (grey && (drops == head.machine.empty() || (!drops && !head.materials.empty()))) return no_such("format", head.format);
  if (head.geometry && (grey || head.levels > 0 || !head.materials.empty() || head.machine.empty()))
    return no_such("images_of", "geometry");
  constexpr std::uint32_t kMaxHeadDrops = 15;
  if (head.head_drops > kMaxHeadDrops || head.sweep_drops < 1 || head.sweep_drops > head.head_drops) {
    return no_such("sweep_drops", fmt::format("{}", head.sweep_drops));
  }
  if (head.machine.empty()) return {};
  for (const JobMaterial& material : head.materials) {
    if (material.vat > 1) return no_such("vat", fmt::format("{}", material.vat));
  }
  const auto* dialect = program::find_dialect(head.dialect);
  if (dialect == nullptr) return no_such("dialect", head.dialect);
  std::string_view end = head.program_extension;
  if (dialect->compressed() && is_compressed(end)) end.remove_suffix(kCompressedEnd.size());
  return end == dialect->extension ? "" : no_such("program_extension", head.program_extension);
}

std::string fault_of_contours(const ManifestHead& head) {
  const auto* slice = formats::find_slice_format(head.format);
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
  if (!read_hex(json.get<std::string>(), hash)) throw std::invalid_argument("invalid hash");
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
  if (head.max_drops > 0) json["max_drops"] = head.max_drops;
  if (head.geometry) json["images_of"] = "geometry";
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
  if (json.contains("max_drops")) json.at("max_drops").get_to(head.max_drops);
  if (json.contains("images_of")) head.geometry = json.at("images_of").text() == "geometry";
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
  if (found == std::end(kKinds)) throw std::invalid_argument(fmt::format("unknown kind '{}'", kind));
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

std::string what_is_impossible(const Layer& layer) {
  const bool possible = layer.bottom >= 0 && layer.thickness > 0 && std::int64_t{layer.bottom} + layer.thickness <= kNmReach;
  return possible ? "" : fmt::format("is at {} nm and is {} nm thick", layer.bottom, layer.thickness);
}

std::string what_is_impossible(const ProgramRecord& program) {
  if (program.added_sweeps > program.sweeps || std::abs(program.added_microseconds) > program.microseconds) {
    return fmt::format("has {} added sweeps in {} microseconds", program.added_sweeps, program.added_microseconds);
  }
  const bool possible = program.microseconds >= 0 && program.microseconds <= kMaxMicroseconds;
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

namespace {

/// Whether a head still has the id of its lines: then it is what some lamina wrote.
bool has_own_id(const std::string& text, const Json& json) {
  const std::size_t lasting = text.find("\n" + text_of("id") + ": ");
  if (lasting == std::string::npos || !json.contains("id") || !json.at("id").is_string()) return false;
  Hash128 id;
  return read_hex(json.at("id").text(), id) && id == hash_text(std::string_view(text).substr(0, lasting + 1));
}

}  // namespace

Result<ManifestHead> read_head(const std::string& text) {
  const auto wrong = [](const std::string& what) { return Error{Fault::kVerification, what}; };
  const auto written_by_another = [&] {
    return wrong(
        "was written by another version of lamina, whose manifests differ from those of this one; read it with that "
        "version, or plan the job again with --overwrite");
  };
  if (!json_nests_within(text)) return wrong("is no manifest of lamina");
  bool fraction = false;
  const Json json = parsed(text + "]}", fraction);
  if (!json.is_object()) return wrong("is no manifest of lamina");
  if (!json.contains("manifest") || json.at("manifest") != kManifestVersion) {
    if (!json.contains("lamina")) return wrong("is no manifest of lamina");
    return written_by_another();
  }
  if (fraction) return wrong("the head has a number that is not whole; it was changed");
  ManifestHead head;
  try {
    head = head_from(json);
  } catch (const std::exception& error) {
    return has_own_id(text, json) ? written_by_another() : wrong(error.what());
  }
  // Written again it has to be the same text: then nothing in it was changed, its id holds, and all of it was read.
  if (head_text(head) != text)
    return has_own_id(text, json) ? written_by_another() : wrong("the head is not what was written; it was changed");
  if (head.first_layer > head.last_layer || head.last_layer > head.layer_count) return wrong("its range of layers is invalid");
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
