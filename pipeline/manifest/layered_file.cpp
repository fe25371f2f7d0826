#include "pipeline/manifest/layered_file.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <optional>
#include <utility>

#include "stages/support/hash/hash.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"

namespace lamina {

namespace fs = std::filesystem;

// --- what an interrupted job has on record

Status check_same_job(const std::string& path, const Manifest& manifest, const ManifestHead& head) {
  const std::string what = difference(head, manifest.head);
  if (!same_job(manifest.head, head)) {
    return Error{Fault::kUsage, fmt::format("{}: belongs to another job ({}); name another file, or use --overwrite", path,
                                            what.empty() ? "its parts or keys differ" : what)};
  }
  if (manifest.head.first_layer == head.first_layer && manifest.head.last_layer == head.last_layer) return {};
  return Error{Fault::kUsage, fmt::format("{}: contains layers {}:{}; resume with the same --layers, or use --overwrite", path,
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

// --- the single file

namespace {

bool is_there(const std::string& path) { return ::access(path.c_str(), F_OK) == 0; }

}  // namespace

struct LayeredFile::State {
  LayeredFileOptions options;
  std::optional<File> file;
  std::optional<ManifestWriter> manifest;  // absent where the file is streamed
  std::vector<LayerRecord> kept;
  bool finished = false;
  std::uint64_t layer_begin = 0, size = 0;
  Hasher hasher;  // of the layer's bytes

  /// Adds a layer to the manifest, after its text: a kill loses neither.
  Status note(const LayerRecord& record) {
    if (!manifest) return {};
    if (Status status = file->flush(); !status) return status;
    return manifest->append(record);
  }

  /// Opens the file, behind the kept layers or with `start`.
  Status open_file(std::string_view start) {
    FileOptions how{.stream = options.stream, .hash = true, .keep_part = true};
    how.replace = options.replace || options.resume;
    if (options.sync == Sync::kOff) how.durable = Durable::kNo;
    auto opened = kept.empty() ? File::open(options.file, how) : File::reopen(options.file, size, how);
    if (!opened) return opened.error();
    file.emplace(std::move(*opened));
    if (kept.empty()) {
      if (Status status = file->append(start); !status) return status;
      size = start.size();
    }
    layer_begin = size;
    return {};
  }

  Status sync() {
    const Status status = file->flush();
    return status ? file->sync() : status;
  }
};

LayeredFile::LayeredFile() : state_(std::make_unique<State>()) {}
LayeredFile::LayeredFile(LayeredFile&&) noexcept = default;
LayeredFile& LayeredFile::operator=(LayeredFile&&) noexcept = default;
LayeredFile::~LayeredFile() = default;

namespace {

/// A run that was killed between its last two names has left a whole file and the whole record of it.
void take_last_name(const std::string& manifest, const std::string& target) {
  const std::string record = part_of(manifest);
  const auto begun = read_manifest(record);
  if (!begun || begun->file.bytes == 0) return;
  const auto digest = digest_file(target, begun->file.bytes);
  if (digest && digest->hash == begun->file.hash) std::rename(record.c_str(), manifest.c_str());
}

/// What a resumed job keeps, read into the state: all of a finished file, or the first records of a begun one. A begun file
/// may exist next to a finished one of another job, which it was to replace.
Status find_kept(const LayeredFile::LayeredFileOptions& options, const ManifestHead& head, std::string_view start,
                 const std::string& target, std::vector<LayerRecord>& kept, std::uint64_t& whole_size) {
  if (!options.resume) return {};
  const std::string begun_file = part_of(target), begun_record = part_of(options.manifest);
  const bool begun = has_manifest_head(begun_record);
  if (begun && !is_there(begun_file) && is_there(target) && !is_there(options.manifest))
    take_last_name(options.manifest, target);
  if (is_there(options.manifest)) {
    auto finished = read_manifest(options.manifest);
    if (!finished && !begun) return finished.error();
    const Status same = finished ? check_same_job(options.manifest, *finished, head) : Status(finished.error());
    if (!same && !begun) return same;
    const auto digest = same && is_there(target) ? digest_file(target) : FileDigest();
    if (same && digest && digest->bytes > 0 && digest->hash == finished->file.hash) {
      for (const std::string& left : {begun_file, begun_record}) remove_or_note(left);
      kept = std::move(finished->layers);
      whole_size = digest->bytes;
      return {};
    }
  }
  if (!begun) return {};
  auto earlier = read_manifest(begun_record);
  if (!earlier) return earlier.error();
  if (Status status = check_same_job(begun_record, *earlier, head); !status) return status;
  if (is_there(begun_file)) kept = records_that_hold(begun_file, earlier->layers, start);
  return {};
}

}  // namespace

Status LayeredFile::check_part(const std::string& file, const std::string& manifest) {
  const auto target = find_target(file);
  if (!target || target->file.empty() || has_manifest_head(part_of(manifest))) return {};
  const std::string part = part_of(target->file);
  struct stat status {};
  if (::lstat(part.c_str(), &status) != 0) return {};
  return Error{Fault::kUsage, fmt::format("{}: is there already, without a record of lamina next to it; remove it, or name "
                                          "another file",
                                          part)};
}

Result<LayeredFile> LayeredFile::open(LayeredFileOptions options, const ManifestHead& head, std::string_view start,
                                      std::optional<Claim> claim) {
  LayeredFile made;
  State& state = *made.state_;
  state.options = std::move(options);
  const std::string &path = state.options.file, &manifest_path = state.options.manifest;
  const auto target = find_target(path);
  if (!target) return target.error();
  const bool streams = target->file.empty();
  if (!streams) {
    if (!claim) {
      auto taken = Claim::take(manifest_path, path);
      if (!taken) return taken.error();
      claim.emplace(std::move(*taken));
    }
    if (Status status = check_begun_manifest(part_of(manifest_path)); !status) return status.error();
    if (Status status = check_part(path, manifest_path); !status) return status.error();
    // A file without any record does not belong to an interrupted job.
    state.options.resume = state.options.resume && has_record(manifest_path);
    if (!state.options.resume && !state.options.replace && is_there(target->file)) {
      return Error{Fault::kUsage,
                   fmt::format("{}: another run has written it meanwhile; name another file, or use --overwrite", path)};
    }
    std::uint64_t whole = 0;
    if (Status status = find_kept(state.options, head, start, target->file, state.kept, whole); !status) return status.error();
    state.finished = whole > 0;
    state.size = whole;
    if (state.finished) return made;
  }
  state.size = state.kept.empty() ? 0 : state.kept.back().offset + state.kept.back().bytes;
  // First the record: a NAME.part without one is somebody else's.
  if (!streams) {
    auto manifest = ManifestWriter::open(manifest_path, head, state.kept,
                                         {state.options.sync, true, [&state] { return state.sync(); }}, std::move(claim));
    if (!manifest) return manifest.error();
    state.manifest.emplace(std::move(*manifest));
  }
  if (Status status = state.open_file(start); !status) {
    if (state.manifest && state.kept.empty()) state.manifest->discard();
    return status.error();
  }
  return made;
}

const std::vector<LayerRecord>& LayeredFile::kept() const { return state_->kept; }
bool LayeredFile::finished() const { return state_->finished; }
std::uint64_t LayeredFile::size() const { return state_->size; }

Status LayeredFile::append(std::string_view text, LayerRecord& record) {
  State& state = *state_;
  record.offset = state.size;
  state.layer_begin = state.size += text.size();
  if (Status status = state.file->append(text); !status) return status;
  return state.note(record);
}

Status LayeredFile::append_piece(std::string_view text) {
  state_->hasher.add(text);
  state_->size += text.size();
  return state_->file->append(text);
}

Status LayeredFile::end_pieces(LayerRecord& record) {
  State& state = *state_;
  record.offset = state.layer_begin;
  record.bytes = state.size - state.layer_begin;
  record.hash = state.hasher.take();
  state.layer_begin = state.size;
  return state.note(record);
}

Result<std::uint64_t> LayeredFile::finish(std::string_view end, const std::function<Status()>& names) {
  State& state = *state_;
  if (state.finished) return state.size;
  if (Status status = state.file->append(end); !status) return status.error();
  state.size += end.size();
  const auto take_names = [&]() -> Status {
    if (Status status = names ? names() : Status(); !status) return status;
    const auto digest = state.file->finish();
    return digest ? Status() : Status(digest.error());
  };
  if (Status status = state.file->flush(); !status) return status.error();
  const Status status = state.manifest ? state.manifest->finish(state.file->digest(), take_names) : take_names();
  return status ? Result<std::uint64_t>(state.size) : status.error();
}

Status LayeredFile::keep() {
  State& state = *state_;
  if (state.file) {
    if (Status status = state.file->flush(); !status) return status;
  }
  return state.manifest ? state.manifest->flush() : Status();
}

void LayeredFile::discard() {
  if (state_->file) state_->file->discard();
  if (state_->manifest) state_->manifest->discard();
}

}  // namespace lamina
