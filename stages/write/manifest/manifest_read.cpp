// Reads manifests, line by line: a hundred thousand layers cost their records and no document tree.
#include <fmt/format.h>

#include <fstream>

#include "stages/data/text/readable.h"
#include "stages/write/manifest/manifest.h"
#include "stages/write/manifest/manifest_head.h"
#include "stages/write/manifest/manifest_line.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestHead = 256u << 20;
constexpr std::string_view kLayers = "\"layers\": [";

/// All up to the first layer; without the last line if the file ends before.
std::string read_head_text(std::ifstream& file, std::uint64_t& lines) {
  std::string head, line;
  while (std::getline(file, line)) {
    ++lines;
    head += line;
    // Heads of an earlier version are indented.
    if (line.ends_with(kLayers) || head.size() > kLongestHead) return head;
    if (lines == 1 && line != "{") return head;
    head += '\n';
  }
  return head;
}

/// Empty, or what is wrong with the line.
std::string read_line(std::string_view line, const ManifestHead& head, std::uint32_t index, LayerRecord& record) {
  LineReader io(line);
  record.layer.index = index;
  record.images.resize(head.materials.size());
  PathFacts paths;
  describe_line(io, head, record, paths);
  if (io.good() && !io.ended()) return "is not the line of a layer";
  if (!io.good()) return fmt::format("layer {}: {}", index, io.what());
  if (record.layer.index != index) return fmt::format("layer {} stands where {} is next", record.layer.index, index);
  if (head.product != Product::kImages) record.paths = std::make_shared<const PathFacts>(paths);
  for (const ImageRecord& image : record.images) {
    record.bytes += image.bytes;
    record.set_pixels += image.set_pixels;
  }
  return {};
}

}  // namespace

Result<Manifest> read_manifest(const std::string& path) {
  const bool partial = path.ends_with(".part");
  std::uint64_t line_number = 0;
  const auto wrong = [&](const std::string& what) {
    return Error{Fault::kVerification, fmt::format("{}:{}: {}", path, line_number, one_line(what))};
  };
  std::ifstream file(path, std::ios::binary);
  if (!file) return Error{Fault::kVerification, fmt::format("{}: cannot be opened", path)};
  const std::string text = read_head_text(file, line_number);
  if (!text.starts_with("{\n")) return wrong("is no manifest of lamina");
  if (!text.ends_with(kLayers)) return wrong("the manifest ends before its first layer");
  auto head = read_head(text);
  if (!head) return wrong(head.error().message);

  Manifest manifest;
  manifest.head = std::move(*head);
  const ManifestHead& range = manifest.head;
  std::string line;
  bool closed = false;
  while (std::getline(file, line)) {
    ++line_number;
    if (line == "]" || line == "],") {
      const std::string rest{std::istreambuf_iterator<char>(file), {}};
      closed = read_tail(range, rest, manifest.file);
      break;
    }
    if (line.ends_with(',')) line.pop_back();
    const auto index = range.first_layer + static_cast<std::uint32_t>(manifest.layers.size());
    LayerRecord record;
    const std::string what = index >= range.last_layer ? "a layer beyond the range" : read_line(line, range, index, record);
    // What a killed run left at the end of its .part is not worth more than its whole lines.
    if (!what.empty() && partial) return manifest;
    if (!what.empty()) return wrong(what);
    manifest.layers.push_back(std::move(record));
  }
  if (!partial && (!closed || manifest.layers.size() != range.last_layer - range.first_layer)) {
    return wrong(
        fmt::format("the manifest ends after {} of {} layers", manifest.layers.size(), range.last_layer - range.first_layer));
  }
  manifest.complete = closed && !partial;
  return manifest;
}

bool has_manifest_head(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::uint64_t lines = 0;
  return file && read_head_text(file, lines).ends_with(kLayers);
}

std::optional<Product> product_of_manifest(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::uint64_t lines = 0;
  const auto head = file ? read_head(read_head_text(file, lines)) : Result<ManifestHead>(Error{Fault::kVerification, ""});
  if (!head) return std::nullopt;
  return head->product;
}

}  // namespace lamina
