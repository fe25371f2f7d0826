#include "pipeline/manifest/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "stages/support/hash/hash.h"
#include "stages/support/io/compressed.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

class PathComparison {
 public:
  PathComparison(const std::string& directory, const Manifest& manifest, Faults& faults)
      : directory_(directory), manifest_(manifest), faults_(faults) {}

  std::uint64_t run() {
    if (!manifest_.head.file.empty()) check_file();
    if (!manifest_.head.extension.empty()) check_layer_files();
    return bytes_;
  }

 private:
  /// The one file of all layers; where it differs, which layers do.
  void check_file() {
    const std::string& name = manifest_.head.file;
    const fs::path path = directory_ / name;
    std::error_code error;
    if (!fs::is_regular_file(path, error)) return faults_.add(fmt::format("{}: is missing", name));
    const auto digest = digest_file(path.string(), manifest_.file.bytes);
    if (!digest) return faults_.add(digest.error().message);
    bytes_ = digest->bytes;
    if (digest->bytes == manifest_.file.bytes && digest->hash == manifest_.file.hash) return check_positions();
    const std::uint64_t before = faults_.fault_count;
    check_intervals(path);
    if (faults_.fault_count > before) return;
    if (digest->bytes != manifest_.file.bytes) {
      faults_.add(fmt::format("{}: {} bytes, the manifest says {}", name, digest->bytes, manifest_.file.bytes));
    } else if (has_intervals()) {
      faults_.add(fmt::format("{}: its content before the first or after the last layer is not what was written", name));
    } else {
      faults_.add(fmt::format("{}: its content is not what was written", name));
    }
  }

  /// Whether layers are stretches of the file; those of a package are not.
  bool has_intervals() const {
    return std::ranges::any_of(manifest_.layers, [](const LayerRecord& record) { return record.bytes > 0; });
  }

  void check_positions() {
    for (std::size_t i = 0; i + 1 < manifest_.layers.size(); ++i) {
      const LayerRecord &layer = manifest_.layers[i], &next = manifest_.layers[i + 1];
      if (layer.offset + layer.bytes == next.offset) continue;
      faults_.add(fmt::format("{}: layer {} begins at byte {}, the manifest says {}", manifest_.head.file, next.layer.index,
                              layer.offset + layer.bytes, next.offset));
    }
  }

  void check_intervals(const fs::path& path) {
    if (!has_intervals()) return;
    const auto file = FileReader::open(path.string(), {});
    if (!file) return faults_.add(file.error().message);
    for (const LayerRecord& record : manifest_.layers) {
      if (record.bytes > file->size() || record.offset > file->size() - record.bytes) {
        return faults_.add(fmt::format("{}: ends within layer {}", manifest_.head.file, record.layer.index));
      }
      if (digest_range(*file, record.offset, record.bytes) == record.hash) continue;
      faults_.add(fmt::format("{}: layer {} is not what was written", manifest_.head.file, record.layer.index));
    }
  }

  void check_layer_files() {
    for (const LayerRecord& record : manifest_.layers) {
      const std::string name = layer_file_name(record.layer.index, manifest_.head.extension);
      bytes_ += record.bytes;
      std::string fault = fault_of_file(directory_.string(), name, record.hash, record.bytes);
      if (!fault.empty()) faults_.add(std::move(fault));
    }
    std::uint64_t found = 0;
    std::error_code error;
    for (fs::directory_iterator entry(directory_ / "layers", error), end; !error && entry != end; entry.increment(error))
      ++found;
    if (found <= manifest_.layers.size()) return;
    faults_.add(fmt::format("layers: contains {} files that the manifest does not name", found - manifest_.layers.size()));
  }

  fs::path directory_;
  const Manifest& manifest_;
  Faults& faults_;
  std::uint64_t bytes_ = 0;
};

}  // namespace

std::string in_directory(const std::string& message, const std::string& path, const std::string& name) {
  return message.starts_with(path) ? name + message.substr(path.size()) : message;
}

std::string fault_of_file(const std::string& directory, const std::string& name, const Hash128& hash,
                          std::optional<std::uint64_t> bytes) {
  const std::string path = (fs::path(directory) / name).string();
  if (!is_file(path)) return fmt::format("{}: is missing", name);
  const Result<FileDigest> digest = digest_content(path, bytes);
  if (!digest) return in_directory(digest.error().message, path, name);
  if (bytes && digest->bytes != *bytes) return fmt::format("{}: {} bytes, the manifest says {}", name, digest->bytes, *bytes);
  return digest->hash == hash ? "" : fmt::format("{}: its content is not what was written", name);
}

std::string fault_of_shares(const ManifestHead& head, const LayerRecord& record) {
  const auto fault = [&](const std::vector<std::uint64_t>& shares, std::uint64_t total, std::string_view what) -> std::string {
    if (shares.empty()) return {};
    if (shares.size() != head.parts.size()) {
      return fmt::format("layer {}: has {} of {} parts, the job has {}", record.layer.index, what, shares.size(),
                         head.parts.size());
    }
    std::uint64_t left = total;
    for (const std::uint64_t share : shares) {
      if (share > left)
        return fmt::format("layer {}: its parts have more {} than the {} of all", record.layer.index, what, total);
      left -= share;
    }
    if (left == 0) return {};
    return fmt::format("layer {}: its parts have {} of the {} {} of all", record.layer.index, total - left, total, what);
  };
  std::string pixels = fault(record.part_pixels, record.filled_pixels(), "pixels");
  return pixels.empty() ? fault(record.part_drops, record.drops, "drops") : pixels;
}

std::string fault_of_one_powder(const LayerRecord& record) {
  for (const ImageRecord& image : record.images) {
    if (image.unfed_pixels > 0)
      return fmt::format("the job uses one powder, the manifest says {} pixels in another one", image.unfed_pixels);
  }
  return {};
}

Status check_shares_known(const ManifestHead& head, const std::vector<LayerRecord>& kept) {
  const auto unknown = std::ranges::count_if(kept, [&](const LayerRecord& record) {
    return record.filled_pixels() > 0 && record.part_pixels.size() != head.parts.size();
  });
  if (unknown == 0 || head.parts.size() < 2) return {};
  return Error{Fault::kUsage,
               fmt::format("--quote: {} layers of an earlier run do not say which part their pixels belong to; "
                           "plan again with --overwrite, or continue without --quote and run lamina verify --quote "
                           "for one quote of all parts",
                           unknown)};
}

std::uint64_t compare_paths(const std::string& directory, const Manifest& manifest, Faults& faults) {
  return PathComparison(directory, manifest, faults).run();
}

void check_shards(const std::vector<ShardRange>& shards, std::uint32_t layers, Faults& faults) {
  std::uint32_t next = 0, layer = 0;
  const auto [ignored, count] = shards.front().shard;
  const auto missing = [&, of = count](std::uint32_t last, std::uint32_t last_layer) {
    if (next == last) return;
    const std::string which = next + 1 == last ? fmt::format("shard {}/{} is", last, of)
                                               : fmt::format("shards {}/{} to {}/{} are", next + 1, of, last, of);
    faults.add(fmt::format("layers: {} missing, with layers {} to {}; run what is missing, or join directories by lamina merge",
                           which, layer, std::max(layer + 1, last_layer) - 1));
  };
  for (const ShardRange& one : shards) {
    const auto [index, of] = one.shard;
    if (of != count)
      return faults.add(fmt::format("{}: divides the layers into another number of shards than {}", one.name, shards[0].name));
    missing(index, one.first_layer);
    next = std::max(next, index + 1);
    layer = one.last_layer;
  }
  missing(count, layers);
}

}  // namespace lamina
