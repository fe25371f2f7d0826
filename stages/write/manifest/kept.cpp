#include "stages/write/manifest/kept.h"

#include <fmt/format.h>

#include <filesystem>

#include "stages/data/hash.h"
#include "stages/data/input/digest_range.h"

namespace lamina {

Status check_same_job(const std::string& path, const Manifest& manifest, const ManifestHead& head) {
  const std::string what = difference(head, manifest.head);
  if (manifest.head.id() != head.id()) {
    return Error{Fault::kUsage, fmt::format("{}: belongs to another job ({}); name another file, or use --overwrite", path,
                                            what.empty() ? "its parts or keys differ" : what)};
  }
  if (manifest.head.first_layer == head.first_layer && manifest.head.last_layer == head.last_layer) return {};
  return Error{Fault::kUsage, fmt::format("{}: is of layers {}:{}; resume with the same --layers, or use --overwrite", path,
                                          manifest.head.first_layer, manifest.head.last_layer)};
}

std::vector<LayerRecord> records_that_hold(const std::string& path, const std::vector<LayerRecord>& recorded,
                                           std::string_view start) {
  std::vector<LayerRecord> kept;
  const auto file = FileReader::open(path, {});
  std::string bytes(start.size(), '\0');
  if (!file || !file->read_at(0, bytes) || bytes != start) return kept;
  std::uint64_t end = start.size();
  for (const LayerRecord& record : recorded) {
    if (record.offset != end || digest_range(*file, record.offset, record.bytes) != record.hash) break;
    end += record.bytes;
    kept.push_back(record);
  }
  return kept;
}

std::vector<LayerRecord> records_with_files(const std::string& folder, const Manifest& manifest) {
  namespace fs = std::filesystem;
  std::vector<LayerRecord> kept;
  for (const LayerRecord& record : manifest.layers) {
    std::error_code ignored;
    const fs::path file = fs::path(folder) / fs::path(layer_file_name(record.layer.index, manifest.head.extension)).filename();
    if (!fs::is_regular_file(fs::symlink_status(file, ignored))) break;
    const auto digest = digest_file(file.string(), record.bytes);
    if (!digest || digest->bytes != record.bytes || digest->hash != record.hash) break;
    kept.push_back(record);
  }
  return kept;
}

}  // namespace lamina
