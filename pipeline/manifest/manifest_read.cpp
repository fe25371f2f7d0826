// Reads manifests, line by line: a hundred thousand layers cost their records and no document tree.
#include <fmt/format.h>

#include "pipeline/manifest/manifest.h"
#include "pipeline/manifest/manifest_head.h"
#include "pipeline/manifest/manifest_line.h"
#include "pipeline/manifest/possible.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/readable.h"

namespace lamina {
namespace {

constexpr std::size_t kLongestHead = 256u << 20, kLongestLine = 1u << 20, kLongestTail = 4096;  // bytes
constexpr ReadRules kRules{.missing = "cannot be opened", .no_text = "is no manifest of lamina", .longest_line = kLongestHead};
constexpr std::string_view kLayers = "\"layers\": [";

/// All up to the first layer; without the last line if the file ends before.
std::string read_head_text(FileReader& file) {
  std::string head;
  for (std::string_view line; file.next(line);) {
    head += line;
    if (line.ends_with(kLayers) || head.size() > kLongestHead) return head;
    if (file.line_number() == 1 && line != "{") return head;
    head += '\n';
  }
  return head;
}

/// Whether what is left of the file closes the manifest.
bool read_rest(FileReader& file, const ManifestHead& head, FileDigest& digest) {
  std::string rest;
  for (std::string_view line; rest.size() <= kLongestTail && file.next(line);) {
    rest += line;
    if (file.ended_by_break()) rest += '\n';
  }
  return file.status().ok() && rest.size() <= kLongestTail && read_tail(head, rest, digest);
}

/// Empty, or what is wrong with the line.
std::string read_line(std::string_view line, const ManifestHead& head, std::uint32_t index, LayerRecord& record) {
  LineReader io(line);
  record.layer.index = index;
  record.images.resize(head.named_images());
  PathFacts paths;
  describe_line(io, head, record, paths);
  if (io.good() && !io.ended()) return "is not the line of a layer";
  if (!io.good()) return fmt::format("layer {}: {}", index, io.what());
  if (record.layer.index != index) return fmt::format("layer {} stands where {} is next", record.layer.index, index);
  for (const std::string& what : {what_is_impossible(record.layer), what_is_impossible(record.program)}) {
    if (!what.empty()) return fmt::format("layer {}: {}", index, what);
  }
  if (head.product != Product::kImages) record.paths = std::make_shared<const PathFacts>(paths);
  if (head.most_drops == 1) record.most_drops = record.drops > 0 ? 1 : 0;
  for (const ImageRecord& image : record.images) {
    record.bytes += image.bytes;
    if (head.drops_of_materials()) continue;
    record.set_pixels += head.materials.empty() && record.set_pixels > 0 ? 0 : image.set_pixels;  // drops fall on the same
    if (head.materials.empty() && image.set_pixels > 0) ++record.most_drops;
  }
  return {};
}

}  // namespace

Result<Manifest> read_manifest(const std::string& path) {
  auto file = FileReader::open(path, kRules);
  return file ? read_manifest(*file) : Result<Manifest>(file.error());
}

Result<Manifest> read_manifest(FileReader& file) {
  const bool partial = file.path().ends_with(".part");
  const auto wrong = [&](const std::string& what) {
    return Error{Fault::kVerification, fmt::format("{}:{}: {}", file.path(), file.line_number(), one_line(what))};
  };
  const std::string text = read_head_text(file);
  if (!file.status()) return file.status().error();
  if (!text.starts_with("{\n")) return wrong("is no manifest of lamina");
  if (!text.ends_with(kLayers)) return wrong("the manifest ends before its first layer");
  auto head = read_head(text);
  if (!head) return wrong(head.error().message);

  Manifest manifest;
  manifest.head = std::move(*head);
  const ManifestHead& range = manifest.head;
  bool closed = false;
  file.bound_lines(kLongestLine);
  for (std::string_view line; !closed && file.next(line);) {
    if (line == "]" || line == "],") {
      closed = read_rest(file, range, manifest.file);
      break;
    }
    if (line.ends_with(',')) line.remove_suffix(1);
    const auto index = range.first_layer + static_cast<std::uint32_t>(manifest.layers.size());
    LayerRecord record;
    const std::string what = index >= range.last_layer ? "a layer beyond the range" : read_line(line, range, index, record);
    // What a killed run left at the end of its .part is not worth more than its whole lines.
    if (!what.empty() && partial) return manifest;
    if (!what.empty()) return wrong(what);
    manifest.layers.push_back(std::move(record));
  }
  if (partial) return manifest;
  if (!file.status()) return file.status().error();
  if (!closed || manifest.layers.size() != range.last_layer - range.first_layer) {
    return wrong(
        fmt::format("the manifest ends after {} of {} layers", manifest.layers.size(), range.last_layer - range.first_layer));
  }
  manifest.complete = true;
  return manifest;
}

Result<ManifestHead> read_manifest_head(const std::string& path) {
  auto file = FileReader::open(path, kRules);
  if (!file) return file.error();
  const std::string text = read_head_text(*file);
  if (!file->status()) return file->status().error();
  auto head = read_head(text);
  return head ? head
              : Result<ManifestHead>(Error{head.error().fault, fmt::format("{}: {}", path, one_line(head.error().message))});
}

bool has_manifest_head(const std::string& path) {
  auto file = FileReader::open(path, kRules);
  return file && read_head_text(*file).ends_with(kLayers);
}

std::optional<Product> product_of_manifest(const std::string& path) {
  const auto head = read_manifest_head(path);
  if (!head) return std::nullopt;
  return head->product;
}

}  // namespace lamina
