#include "pipeline/manifest/kept.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "stages/support/hash/hash.h"
#include "stages/support/io/temporary.h"

namespace lamina {

Status check_same_job(const std::string& path, const Manifest& manifest, const ManifestHead& head) {
  const std::string what = difference(head, manifest.head);
  if (!same_job(manifest.head, head)) {
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

namespace fs = std::filesystem;

OnRecord find_on_record(const std::string& directory) {
  const std::string path = (fs::path(directory) / "manifest.json").string();
  std::error_code error;
  OnRecord found{fs::exists(path, error), has_manifest_head(part_of(path)), false, {}};
  if (const auto begun = found.begun ? read_manifest(part_of(path)) : Result<Manifest>(Manifest()); begun) {
    found.all_made = found.begun && begun->layers.size() == begun->head.last_layer - begun->head.first_layer;
  }
  if (!found.finished) return found;
  const auto manifest = read_manifest(path);
  if (!manifest || manifest->head.extension.empty()) return found;
  for (const LayerRecord& record : manifest->layers)
    found.layers.push_back(layer_file_name(record.layer.index, manifest->head.extension));
  std::ranges::sort(found.layers);
  return found;
}

bool is_on_record(const OnRecord& record, std::string_view name) {
  return std::ranges::binary_search(record.layers, fmt::format("layers/{}", name));
}

Status check_takes_layers(const std::string& folder) {
  std::error_code error;
  const fs::file_status status = fs::status(folder, error);
  if (!fs::exists(status)) return {};
  if (!fs::is_directory(status)) return Error{Fault::kOutput, fmt::format("{}: is a file, not a directory; remove it", folder)};
  if (::access(folder.c_str(), W_OK | X_OK) == 0) return {};
  return Error{Fault::kOutput, fmt::format("{}: {}", folder, std::strerror(errno))};
}

Status take_waiting(const std::string& waiting, const std::string& folder) {
  std::error_code error;
  fs::rename(waiting, folder, error);  // takes the place of an empty directory too
  if (!error) return {};
  error.clear();
  for (fs::directory_iterator entry(waiting, error), end; !error && entry != end; entry.increment(error)) {
    fs::rename(entry->path(), fs::path(folder) / entry->path().filename(), error);
    if (error) break;
  }
  if (!error) fs::remove(waiting, error);
  return error ? Status(Error{Fault::kOutput, fmt::format("{}: {}", folder, error.message())}) : Status();
}

namespace {

bool is_plain(const fs::path& path, fs::file_type type) {
  std::error_code ignored;
  return fs::symlink_status(path, ignored).type() == type;
}

/// Whether a file is there as it was recorded.
bool holds(const fs::path& file, std::uint64_t bytes, const Hash128& hash) {
  if (!is_plain(file, fs::file_type::regular)) return false;
  const auto digest = digest_file(file.string(), bytes);
  return digest && digest->bytes == bytes && digest->hash == hash;
}

/// Whether all files of a finished job are there as they were recorded.
bool is_whole(const std::string& directory, const Manifest& manifest) {
  const ManifestHead& head = manifest.head;
  const fs::path position = directory;
  if (!head.file.empty()) return holds(position / head.file, manifest.file.bytes, manifest.file.hash);
  return head.extension.empty() || std::ranges::all_of(manifest.layers, [&](const LayerRecord& record) {
           return holds(position / layer_file_name(record.layer.index, head.extension), record.bytes, record.hash);
         });
}

/// The records, from the first on, whose files wait.
/// named  files may have their names already: those are brought back
std::vector<LayerRecord> waiting_records(const fs::path& directory, const fs::path& waiting, const Manifest& begun,
                                         bool named) {
  std::vector<LayerRecord> kept;
  std::error_code error;
  if (named) fs::create_directory(waiting, error);
  if (begun.head.extension.empty() || !is_plain(waiting, fs::file_type::directory)) return kept;
  for (const LayerRecord& record : begun.layers) {
    const fs::path file = directory / layer_file_name(record.layer.index, begun.head.extension),
                   fresh = waiting / file.filename();
    if (!holds(fresh, record.bytes, record.hash)) {
      if (!named || !holds(file, record.bytes, record.hash)) break;
      fs::rename(file, fresh, error);
      if (error) break;
    }
    kept.push_back(record);
  }
  for (fs::directory_iterator entry(waiting, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!named_by_temporary(name).empty()) remove_or_note(entry->path().string());
  }
  return kept;
}

}  // namespace

Result<KeptJob> find_kept_job(const std::string& directory, const std::string& waiting, const ManifestHead& head) {
  const std::string path = (fs::path(directory) / "manifest.json").string(), begun_path = part_of(path);
  const bool begun = has_manifest_head(begun_path), finished = is_plain(path, fs::file_type::regular);
  KeptJob kept;
  if (finished) {
    auto manifest = read_manifest(path);
    const Status same = manifest ? check_same_job(path, *manifest, head) : Status(manifest.error());
    if (!same && !begun) return same.error();
    kept.finished = same && is_whole(directory, *manifest);
    if (kept.finished) kept.layers = std::move(manifest->layers);
    if (kept.finished) kept.bytes = manifest->file.bytes;  // of a package; its layers have none of their own
  }
  if (begun && !kept.finished) {
    const auto manifest = read_manifest(begun_path);
    if (!manifest) return manifest.error();
    if (Status status = check_same_job(begun_path, *manifest, head); !status) return status.error();
    kept.layers = waiting_records(directory, waiting, *manifest, !finished);
  }
  for (const LayerRecord& record : kept.layers) kept.bytes += record.bytes;
  return kept;
}

}  // namespace lamina
