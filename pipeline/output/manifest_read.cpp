// Reads manifests, line by line: a hundred thousand layers cost their records and no document tree.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "pipeline/output/manifest.h"
#include "pipeline/output/manifest_text.h"
#include "pipeline/text/json_text.h"

namespace lamina::pipeline {
namespace {

using nlohmann::json;

std::int64_t nm_from_json(const json& millimetres) { return nm_of(millimetres.get<double>()); }

Point3 point_from(const json& coordinates) {
  const auto nm = [&](std::size_t i) { return static_cast<Nm>(nm_from_json(coordinates.at(i))); };
  return {nm(0), nm(1), nm(2)};
}

PixelAxis axis_from(const json& dots, const json& millimetres) {
  const std::int64_t length = nm_from_json(millimetres);
  if (!dots.is_string()) return PixelAxis(dots.get<std::int64_t>(), length);
  long long in_span = 1, span = kNmPerInch;
  const std::string text = dots;
  std::sscanf(text.c_str(), "%lld in %lld nm", &in_span, &span);
  return PixelAxis(std::max(1LL, in_span), length, std::max(1LL, span));
}

// Throws json::exception where something is missing or of another type.
ManifestHead head_from(const json& text) {
  ManifestHead head;
  head.version = text.at("lamina");
  head.job_toml = text.at("job");
  head.format = text.at("format");
  head.extension = text.at("extension");
  head.fill_rule = text.at("fill_rule");
  head.mirror = text.at("mirror");
  head.grid.x = axis_from(text.at("dpi").at(0), text.at("bed_mm").at(0));
  head.grid.y = axis_from(text.at("dpi").at(1), text.at("bed_mm").at(1));
  head.layer_count = text.at("layer_count");
  head.first_layer = text.at("range").at(0);
  head.last_layer = text.at("range").at(1);
  for (const json& entry : text.at("parts")) {
    PartSummary part;
    part.path = entry.at("path");
    part.copies = entry.at("copies");
    part.triangles = entry.at("triangles");
    part.fingerprint = std::stoull(entry.at("fingerprint").get<std::string>(), nullptr, 16);
    part.bounds = {point_from(entry.at("bounds_mm").at(0)), point_from(entry.at("bounds_mm").at(1))};
    for (const json& note : entry.at("notes")) part.notes.push_back({note.at("repair"), note.at("text")});
    head.parts.push_back(std::move(part));
  }
  if (text.contains("materials")) {
    for (const json& entry : text.at("materials")) head.materials.push_back({entry.at("name"), entry.at("vat")});
  }
  if (text.contains("machine")) {
    const json& machine = text.at("machine");
    head.machine = machine.at("name");
    head.dialect = machine.at("dialect");
    head.program_extension = machine.at("extension");
    const auto hash = [&](const char* key, Hash128& to) { return read_hex(machine.at(key).get<std::string>(), to); };
    if (!hash("profile_xxh3_128", head.machine_profile) || !hash("start_xxh3_128", head.program_start) ||
        !hash("end_xxh3_128", head.program_end)) {
      head.machine.clear();
    }
  }
  return head;
}

// A line of one layer, read exactly as add_record_text writes it: a hundred thousand of them in a few hundredths of a
// second, and no spelling that nobody wrote is accepted.
class RecordLine {
 public:
  explicit RecordLine(std::string_view line) : rest_(line) {}

  RecordLine& text(std::string_view expected) {
    good_ = good_ && rest_.starts_with(expected);
    if (good_) rest_.remove_prefix(expected.size());
    return *this;
  }
  template <class Integer>
  RecordLine& number(Integer& value) {
    const auto [stop, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    good_ = good_ && error == std::errc();
    if (good_) rest_.remove_prefix(static_cast<std::size_t>(stop - rest_.data()));
    return *this;
  }
  /// All up to the next quotation mark.
  RecordLine& word(std::string_view& value) {
    value = rest_.substr(0, rest_.find('"'));
    rest_.remove_prefix(value.size());
    return *this;
  }
  bool ended() const { return good_ && rest_.empty(); }

 private:
  std::string_view rest_;
  bool good_ = true;
};

// clang-format off
// The middle of the line of a layer with several materials: empty, or what is wrong with it.
std::string images_from(RecordLine& read, const ManifestHead& head, std::uint32_t index, LayerRecord& record) {
  std::string_view reason;
  read.text(", \"bottom_nm\": ").number(record.layer.bottom)
      .text(", \"thickness_nm\": ").number(record.layer.thickness)
      .text(", \"reason\": \"").word(reason)
      .text("\", \"capped_rows\": ").number(record.capped_rows)
      .text(", \"images\": [");
  for (std::size_t m = 0; m < head.materials.size(); ++m) {
    ImageRecord image;
    std::string_view file, hash;
    read.text(m == 0 ? "{\"file\": \"" : ", {\"file\": \"").word(file)
        .text("\", \"bytes\": ").number(image.bytes)
        .text(", \"set_pixels\": ").number(image.set_pixels)
        .text(", \"xxh3_128\": \"").word(hash)
        .text("\"}");
    if (file != layer_file_name(index, head.extension, head.materials[m].name)) return fmt::format("layer {} names another file", index);
    if (!read_hex(hash, image.hash)) return fmt::format("layer {} has a hash that is none", index);
    record.bytes += image.bytes;
    record.set_pixels += image.set_pixels;
    record.images.push_back(image);
  }
  read.text("]");
  if (!read_reason(reason, record.layer.reason)) return fmt::format("layer {} has a reason that is none", index);
  return {};
}

// Empty, or what is wrong with the line.
std::string record_from(std::string_view line, const ManifestHead& head, std::uint32_t index, LayerRecord& record) {
  std::string_view file, reason, hash;
  RecordLine read(line);
  read.text("{\"index\": ").number(record.layer.index);
  if (!head.materials.empty()) {
    if (std::string what = images_from(read, head, index, record); !what.empty()) return what;
  } else {
    read.text(", \"file\": \"").word(file)
        .text("\", \"bottom_nm\": ").number(record.layer.bottom)
        .text(", \"thickness_nm\": ").number(record.layer.thickness)
        .text(", \"reason\": \"").word(reason)
        .text("\", \"bytes\": ").number(record.bytes)
        .text(", \"set_pixels\": ").number(record.set_pixels)
        .text(", \"capped_rows\": ").number(record.capped_rows)
        .text(", \"xxh3_128\": \"").word(hash)
        .text("\"");
  }
  std::string_view program_hash;
  if (!head.machine.empty()) {
    read.text(", \"program\": {\"bytes\": ").number(record.program.bytes)
        .text(", \"sweeps\": ").number(record.program.sweeps)
        .text(", \"drops\": ").number(record.program.drops)
        .text(", \"moved\": ").number(record.program.moved)
        .text(", \"lost\": ").number(record.program.lost)
        .text(", \"xxh3_128\": \"").word(program_hash)
        .text("\"}");
  }
  const bool ended = read.text("}").ended();
  if (!ended) return "is not the line of a layer";
  if (record.layer.index != index) return fmt::format("layer {} stands where {} is next", record.layer.index, index);
  if (head.materials.empty()) {
    if (file != layer_file_name(index, head.extension)) return fmt::format("layer {} names another file", index);
    if (!read_reason(reason, record.layer.reason)) return fmt::format("layer {} has a reason that is none", index);
    if (!read_hex(hash, record.hash)) return fmt::format("layer {} has a hash that is none", index);
  }
  if (!head.machine.empty() && !read_hex(program_hash, record.program.hash)) {
    return fmt::format("layer {} has a program with a hash that is none", index);
  }
  return {};
}
// clang-format on

}  // namespace

Result<Manifest> read_manifest(const std::string& path) {
  const bool partial = path.ends_with(".part");
  std::uint64_t line_number = 0;
  const auto wrong = [&](const std::string& what) {
    return Error{Fault::kVerification, fmt::format("{}:{}: {}", path, line_number, one_line(what))};
  };
  std::ifstream file(path, std::ios::binary);
  if (!file) return Error{Fault::kVerification, fmt::format("{}: cannot be opened", path)};

  Manifest manifest;
  std::string line, head;
  try {
    constexpr std::size_t kHeadLimit = 256u << 20;
    while (std::getline(file, line)) {
      ++line_number;
      head += line;
      if (line == "\"layers\": [") break;
      head += '\n';
      if (line_number == 1 && line != "{") return wrong("is no manifest of lamina");
      if (head.size() > kHeadLimit) return wrong("the head does not end");
    }
    if (line != "\"layers\": [") return wrong("the manifest ends before its first layer");
    const json document = json::parse(head + "]}");
    manifest.head = head_from(document);
    // Written again it has to be the same text: then nothing in it was changed, its id holds, and all of it was read.
    if (head_text(manifest.head) != head) {
      return wrong("the head is not what was written; it was changed, or is of another version of lamina");
    }
    const ManifestHead& range = manifest.head;
    if (range.first_layer > range.last_layer || range.last_layer > range.layer_count) return wrong("the range is no range");

    bool closed = false;
    while (std::getline(file, line)) {
      ++line_number;
      if (line == "]") {
        closed = std::getline(file, line) && line == "}";
        break;
      }
      if (line.ends_with(',')) line.pop_back();
      const auto index = range.first_layer + static_cast<std::uint32_t>(manifest.layers.size());
      LayerRecord record;
      const std::string what = index >= range.last_layer ? "a layer beyond the range" : record_from(line, range, index, record);
      // What a killed run left at the end of its .part is not worth more than its whole lines.
      if (!what.empty() && partial) return manifest;
      if (!what.empty()) return wrong(what);
      manifest.layers.push_back(record);
    }
    if (!partial && (!closed || manifest.layers.size() != range.last_layer - range.first_layer)) {
      return wrong(
          fmt::format("the manifest ends after {} of {} layers", manifest.layers.size(), range.last_layer - range.first_layer));
    }
    manifest.complete = closed && !partial;
  } catch (const std::exception& error) {
    return wrong(error.what());
  }
  return manifest;
}

}  // namespace lamina::pipeline
