#include "stages/write/manifest/layered_file.h"

#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <cstring>
#include <fstream>
#include <optional>
#include <utility>

#include "stages/write/file.h"

namespace lamina {
namespace {

bool is_there(const std::string& path) { return ::access(path.c_str(), F_OK) == 0; }

/// XXH3-128 of a layer's bytes, piece by piece.
class Hasher {
 public:
  Hasher() { XXH3_128bits_reset(state_.get()); }
  void add(std::string_view text) { XXH3_128bits_update(state_.get(), text.data(), text.size()); }
  /// The hash, and begins anew.
  Hash128 take() {
    const XXH128_hash_t hash = XXH3_128bits_digest(state_.get());
    XXH3_128bits_reset(state_.get());
    return {hash.high64, hash.low64};
  }

 private:
  std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state_{XXH3_createState(), &XXH3_freeState};
};

/// Refuses records of another job. errors  kUsage
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

/// The records, from the first on, whose bytes are in the file; none if it does not begin with `start`.
std::vector<LayerRecord> records_that_hold(const std::string& path, const std::vector<LayerRecord>& recorded,
                                           std::string_view start) {
  std::ifstream file(path, std::ios::binary);
  std::vector<LayerRecord> kept;
  std::string bytes(start.size(), '\0');
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size())) || bytes != start) return kept;
  std::uint64_t end = start.size();
  Hasher hasher;
  std::vector<char> piece(1 << 20);
  for (const LayerRecord& record : recorded) {
    if (record.offset != end) break;
    std::uint64_t left = record.bytes;
    while (left > 0) {
      const auto size = static_cast<std::streamsize>(std::min<std::uint64_t>(left, piece.size()));
      if (!file.read(piece.data(), size)) return kept;
      hasher.add({piece.data(), static_cast<std::size_t>(size)});
      left -= static_cast<std::uint64_t>(size);
    }
    if (hasher.take() != record.hash) break;
    end += record.bytes;
    kept.push_back(record);
  }
  return kept;
}

}  // namespace

struct LayeredFile::State {
  Options options;
  std::optional<write::File> file;
  std::optional<ManifestWriter> manifest;  // absent where the file is streamed
  std::vector<LayerRecord> kept;
  bool finished = false;
  std::uint64_t layer_begin = 0, size = 0;
  Hasher hasher;
};

LayeredFile::LayeredFile() : state_(std::make_unique<State>()) {}
LayeredFile::LayeredFile(LayeredFile&&) noexcept = default;
LayeredFile& LayeredFile::operator=(LayeredFile&&) noexcept = default;
LayeredFile::~LayeredFile() = default;

Result<LayeredFile> LayeredFile::open(Options options, const ManifestHead& head, std::string_view start) {
  LayeredFile made;
  State& state = *made.state_;
  state.options = std::move(options);
  const std::string &path = state.options.file, &manifest_path = state.options.manifest;
  const bool whole = is_there(path) && is_there(manifest_path);
  const std::string part = manifest_path + ".part";
  if (state.options.resume && (whole || has_manifest_head(part))) {
    auto earlier = read_manifest(whole ? manifest_path : part);
    if (!earlier) return earlier.error();
    if (Status status = check_same_job(whole ? manifest_path : part, *earlier, head); !status) return status.error();
    if (whole) {
      const auto digest = digest_file(path);
      state.finished = digest && digest->hash == earlier->file.hash;
      if (state.finished) {
        state.kept = std::move(earlier->layers);
        state.size = digest->bytes;
        return made;
      }
    } else if (is_there(path + ".part")) {
      state.kept = records_that_hold(path + ".part", earlier->layers, start);
    }
  }
  const write::FileOptions how{.stream = state.options.stream, .hash = true, .keep_part = true};
  state.size = state.kept.empty() ? 0 : state.kept.back().offset + state.kept.back().bytes;
  auto file = state.kept.empty() ? write::File::open(path, how) : write::File::reopen(path, state.size, how);
  if (!file) return file.error();
  state.file.emplace(std::move(*file));
  if (state.kept.empty()) {
    if (Status status = state.file->append(start); !status) return status.error();
    state.size = start.size();
  }
  state.layer_begin = state.size;
  if (state.file->streams()) return made;
  auto manifest = ManifestWriter::open(manifest_path, head, state.kept);
  if (!manifest) return manifest.error();
  state.manifest.emplace(std::move(*manifest));
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
  return state.manifest ? state.manifest->append(record) : Status();
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
  return state.manifest ? state.manifest->append(record) : Status();
}

Result<std::uint64_t> LayeredFile::finish(std::string_view end) {
  State& state = *state_;
  if (state.finished) return state.size;
  if (Status status = state.file->append(end); !status) return status.error();
  state.size += end.size();
  const auto digest = state.file->finish();
  if (!digest) return digest.error();
  if (state.manifest) {
    if (Status status = state.manifest->finish(*digest); !status) return status.error();
  }
  return state.size;
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
