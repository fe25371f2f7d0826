#include "pipeline/check/verify_paths.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "stages/data/hash.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

class PathVerifier {
 public:
  PathVerifier(const std::string& name, const std::string& directory, const Manifest& manifest)
      : directory_(directory), manifest_(manifest) {
    report_.directory = name;
    report_.layers = manifest.layers.size();
  }

  VerifyReport run() {
    if (!manifest_.head.file.empty()) check_file();
    if (!manifest_.head.extension.empty()) check_layer_files();
    return std::move(report_);
  }

 private:
  void fault(std::string text) {
    constexpr std::size_t kFaultsTold = 20;
    if (report_.faults.size() < kFaultsTold) report_.faults.push_back(std::move(text));
    ++report_.fault_count;
  }

  /// The one file of all layers; where it differs, which layers do.
  void check_file() {
    const std::string& name = manifest_.head.file;
    const fs::path path = directory_ / name;
    std::error_code error;
    if (!fs::is_regular_file(path, error)) return fault(fmt::format("{}: is missing", name));
    const auto digest = digest_file(path.string());
    if (!digest) return fault(digest.error().message);
    report_.bytes = digest->bytes;
    if (digest->bytes == manifest_.file.bytes && digest->hash == manifest_.file.hash) return check_places();
    const std::uint64_t before = report_.fault_count;
    check_stretches(path);
    if (report_.fault_count > before) return;
    if (digest->bytes != manifest_.file.bytes) {
      fault(fmt::format("{}: {} bytes, the manifest says {}", name, digest->bytes, manifest_.file.bytes));
    } else if (has_stretches()) {
      fault(fmt::format("{}: before its first or behind its last layer it is not what was written", name));
    } else {
      fault(fmt::format("{}: its content is not what was written", name));
    }
  }

  /// Whether layers are stretches of the file; those of a package are not.
  bool has_stretches() const {
    return std::ranges::any_of(manifest_.layers, [](const LayerRecord& record) { return record.bytes > 0; });
  }

  void check_places() {
    for (std::size_t i = 0; i + 1 < manifest_.layers.size(); ++i) {
      const LayerRecord &layer = manifest_.layers[i], &next = manifest_.layers[i + 1];
      if (layer.offset + layer.bytes == next.offset) continue;
      fault(fmt::format("{}: layer {} begins at byte {}, the manifest says {}", manifest_.head.file, next.layer.index,
                        layer.offset + layer.bytes, next.offset));
    }
  }

  void check_stretches(const fs::path& path) {
    if (!has_stretches()) return;
    std::ifstream file(path, std::ios::binary);
    std::error_code error;
    const std::uint64_t size = fs::file_size(path, error);
    std::string text;
    for (const LayerRecord& record : manifest_.layers) {
      if (record.bytes > size || record.offset > size - record.bytes) {
        return fault(fmt::format("{}: ends within layer {}", manifest_.head.file, record.layer.index));
      }
      text.resize(record.bytes);
      file.seekg(static_cast<std::streamoff>(record.offset));
      file.read(text.data(), static_cast<std::streamsize>(text.size()));
      if (file && hash_bytes(std::as_bytes(std::span(text))) == record.hash) continue;
      fault(fmt::format("{}: layer {} is not what was written", manifest_.head.file, record.layer.index));
    }
  }

  void check_layer_files() {
    for (const LayerRecord& record : manifest_.layers) {
      const std::string name = layer_file_name(record.layer.index, manifest_.head.extension);
      report_.bytes += record.bytes;
      std::error_code error;
      if (!fs::is_regular_file(directory_ / name, error)) {
        fault(fmt::format("{}: is missing", name));
        continue;
      }
      const auto digest = digest_file((directory_ / name).string());
      if (!digest) {
        fault(digest.error().message);
      } else if (digest->bytes != record.bytes) {
        fault(fmt::format("{}: {} bytes, the manifest says {}", name, digest->bytes, record.bytes));
      } else if (digest->hash != record.hash) {
        fault(fmt::format("{}: its content is not what was written", name));
      }
    }
    std::uint64_t found = 0;
    std::error_code error;
    for (fs::directory_iterator entry(directory_ / "layers", error), end; !error && entry != end; entry.increment(error))
      ++found;
    if (found <= manifest_.layers.size()) return;
    fault(fmt::format("layers: holds {} files that the manifest does not name", found - manifest_.layers.size()));
  }

  fs::path directory_;
  const Manifest& manifest_;
  VerifyReport report_;
};

}  // namespace

VerifyReport verify_paths(const std::string& name, const std::string& directory, const Manifest& manifest) {
  return PathVerifier(name, directory, manifest).run();
}

}  // namespace lamina::pipeline
