// pipeline/manifest/manifest.cpp: the head of a manifest, and the file that grows while a job runs.
#include "pipeline/manifest/manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/manifest/manifest_text.h"
#include "stages/formats/image_format.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/paged.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina {

namespace fs = std::filesystem;

Hash128 ManifestHead::id() const {
  const std::string text = lasting_text(*this);
  return hash_bytes(std::as_bytes(std::span(text)));
}

std::string title_of(const std::vector<PartSummary>& parts) {
  if (parts.empty()) return {};
  const std::string name = fs::path(parts.front().path).filename().string();
  return parts.size() == 1 ? name : name + " and " + std::to_string(parts.size() - 1) + " more";
}

namespace {

constexpr std::string_view kOtherBuild = "another build of lamina wrote it";

/// The keys of a job's text, "section.name", with their values; those of part n begin with "part.n.".
std::vector<std::array<std::string, 2>> said_by(std::string_view job) {
  std::vector<std::array<std::string, 2>> said;
  std::string section;
  std::size_t parts = 0;
  for (const std::string_view line : split(job, "\n")) {
    const std::size_t equals = std::min(line.find(" = "), line.size());
    if (line.starts_with("[[")) {
      section = fmt::format("part.{}", ++parts);
    } else if (line.starts_with('[')) {
      section = line.substr(1, line.find(']') - 1);
    } else if (!line.empty()) {
      said.push_back(
          {fmt::format("{}.{}", section, line.substr(0, equals)), std::string(line.substr(std::min(equals + 3, line.size())))});
    }
  }
  return said;
}

/// The first key that differs; "" if none does.
std::string difference_of_jobs(std::string_view now, std::string_view earlier) {
  std::map<std::string, std::string> said;
  for (const auto& [key, value] : said_by(earlier)) said[key] = value;
  for (const auto& [key, value] : said_by(now)) {
    const auto before = said.find(key);
    if (before == said.end()) {
      return fmt::format("{} = {}, of which it says nothing: it was not set, or {}", key, value, kOtherBuild);
    }
    if (value != before->second) return fmt::format("{} = {}, was {}", key, value, before->second);
    said.erase(before);
  }
  return said.empty() ? "" : fmt::format("{} is set no more, or {}", said.begin()->first, kOtherBuild);
}

}  // namespace

bool same_job(const ManifestHead& one, const ManifestHead& other) { return one.id() == other.id(); }

std::string difference(const ManifestHead& now, const ManifestHead& earlier) {
  if (same_job(now, earlier)) return {};
  if (now.version != earlier.version) return fmt::format("lamina is {}, was {}", now.version, earlier.version);
  if (std::string what = difference_of_jobs(now.job_toml, earlier.job_toml); !what.empty()) {
    return what.starts_with("part.") && now.parts.size() != earlier.parts.size() ? "the parts are others" : what;
  }
  for (std::size_t i = 0; i < std::min(now.parts.size(), earlier.parts.size()); ++i) {
    if (now.parts[i].fingerprint != earlier.parts[i].fingerprint) {
      return fmt::format("the geometry of {} has changed", now.parts[i].path);
    }
  }
  if (now.machine != earlier.machine) return fmt::format("machine {}, was {}", now.machine, earlier.machine);
  if (now.machine_profile != earlier.machine_profile) {
    return fmt::format("the machine's profile has changed, or {}", kOtherBuild);
  }
  if (now.program_start != earlier.program_start || now.program_end != earlier.program_end) {
    return fmt::format("{}, with other print programs", kOtherBuild);
  }
  return "the parts have changed";
}

bool has_record(const std::string& path) {
  std::error_code error;
  return fs::exists(path, error) || has_manifest_head(part_of(path));
}

Status check_begun_manifest(const std::string& part) {
  const auto file = FileReader::open(part, {});
  char first = 0;  // stays 0 where a power cut has kept the size alone
  if (!file || !file->read_at(0, {&first, 1}) || first == '{' || first == 0) return {};
  return Error{Fault::kUsage,
               fmt::format("{}: is there already, and is no record of lamina; remove it, or name another output", part)};
}

std::uint8_t grey_level_of(std::uint32_t max_drops) {
  return max_drops <= 1 ? 1 : max_drops <= 3 ? 3 : max_drops <= 15 ? 15 : 255;
}

bool ManifestHead::grey_drops() const { return max_drops > 0 && formats::find_level_format(format) != nullptr; }

std::uint8_t ManifestHead::full_level() const {
  if (grey_drops()) return grey_level_of(max_drops);
  return static_cast<std::uint8_t>(levels > 0 && max_drops == 0 ? levels - 1 : 0);
}

std::uint8_t ManifestHead::max_of_pixel() const {
  return std::max<std::uint8_t>(1, max_drops > 0 ? static_cast<std::uint8_t>(max_drops) : full_level());
}

std::string ManifestHead::image_name(std::size_t number) const {
  const std::uint32_t drops = drop_images();
  const std::string material = materials.empty() ? "" : materials[number / drops].name;
  if (drops == 1) return material;
  return fmt::format("{}{}drop{}", material, material.empty() ? "" : "-", number % drops + 1);
}

std::string layer_file_name(std::uint32_t index, std::string_view extension, std::string_view image) {
  if (extension.empty()) return {};
  return fmt::format("layers/{:06}{}{}{}", index, image.empty() ? "" : "-", image, extension);
}

std::vector<LayerImageFile> layer_images(const ManifestHead& head, const LayerRecord& record) {
  std::vector<LayerImageFile> files;
  const std::size_t named = head.named_images();
  if (named == 0) {
    files.push_back({layer_file_name(record.layer.index, head.extension),
                     {record.bytes, head.geometry ? record.geometry_pixels : record.set_pixels, 0, 0, record.hash}});
  }
  for (std::size_t m = 0; m < named; ++m) {
    files.push_back({layer_file_name(record.layer.index, head.extension, head.image_name(m)),
                     m < record.images.size() ? record.images[m] : ImageRecord()});
  }
  return files;
}

namespace {

void add_line(const LayerRecord& record, const ManifestHead& head, bool first, std::string& text) {
  static const PathFacts kNone;
  text += first ? "\n" : ",\n";
  LineWriter io(text);
  describe_line(io, head, record, record.paths ? *record.paths : kNone);
}

}  // namespace

struct ManifestWriter::State {
  File file;
  ManifestHead head;
  ManifestOptions options;
  std::string buffer;
  std::uint32_t next_layer = 0;
  bool first_line = true;

  State(File opened, const ManifestHead& of, ManifestOptions chosen)
      : file(std::move(opened)), head(of), options(std::move(chosen)), next_layer(of.first_layer) {}

  void add(const LayerRecord& record) {
    add_line(record, head, std::exchange(first_line, false), buffer);
    ++next_layer;
  }

  Status flush() {
    const bool syncs = options.sync == Sync::kLayer && !buffer.empty();
    if (syncs && options.sync_layers) {
      if (Status status = options.sync_layers(); !status) return status;
    }
    if (Status status = file.append(buffer); !status) return status;
    buffer.clear();
    if (Status status = file.flush(); !status) return status;
    return syncs ? file.sync() : Status();
  }

  /// Appends what follows the last layer.
  Status close(const FileDigest& digest) {
    if (next_layer != head.last_layer)
      return Error{Fault::kInternal, fmt::format("manifest: closed at layer {} of {}", next_layer, head.last_layer)};
    buffer += tail_text(head, digest);
    return flush();
  }
};

ManifestWriter::ManifestWriter() = default;
ManifestWriter::ManifestWriter(ManifestWriter&&) noexcept = default;
ManifestWriter& ManifestWriter::operator=(ManifestWriter&&) noexcept = default;
ManifestWriter::~ManifestWriter() = default;

namespace {

/// Appends head and kept records.
Status begin(File& file, const ManifestHead& head, const std::vector<LayerRecord>& kept) {
  std::string text = head_text(head);
  std::uint32_t next = head.first_layer;
  for (const LayerRecord& record : kept) {
    if (record.layer.index != next++) {
      return Error{Fault::kInternal, fmt::format("manifest: layer {} kept where {} is next", record.layer.index, next - 1)};
    }
    add_line(record, head, &record == &kept.front(), text);
    if (text.size() < (1u << 20)) continue;
    if (Status status = file.append(std::string_view(text)); !status) return status;
    text.clear();
  }
  return file.append(std::string_view(text));
}

}  // namespace

Result<ManifestWriter> ManifestWriter::open(const std::string& path, const ManifestHead& head,
                                            const std::vector<LayerRecord>& kept_prefix, ManifestOptions options,
                                            std::optional<Claim> claim) {
  if (!claim) {
    auto taken = Claim::take(path, path);
    if (!taken) return taken.error();
    claim.emplace(std::move(*taken));
  }
  FileOptions how{.lock = false, .follow = false};
  if (options.sync == Sync::kOff) how.durable = Durable::kNo;
  auto file = File::open(path, how);
  if (!file) return file.error();
  if (Status status = begin(*file, head, kept_prefix); !status) return status.error();
  claim->hand_over();
  if (Status status = file->become_part(options.sync_head); !status) return status.error();
  ManifestWriter writer;
  writer.state_ = std::make_unique<State>(std::move(*file), head, std::move(options));
  writer.state_->next_layer = head.first_layer + static_cast<std::uint32_t>(kept_prefix.size());
  writer.state_->first_line = kept_prefix.empty();
  return writer;
}

Status ManifestWriter::append(const LayerRecord& record) {
  State& state = *state_;
  if (record.layer.index != state.next_layer || record.layer.index >= state.head.last_layer) {
    return Error{Fault::kInternal, fmt::format("manifest: layer {} appended where {} of {} is next", record.layer.index,
                                               state.next_layer, state.head.last_layer)};
  }
  state.add(record);
  return state.flush();
}

Status ManifestWriter::flush() { return state_->flush(); }

Status ManifestWriter::finish(const FileDigest& file, const std::function<Status()>& names) {
  State& state = *state_;
  if (Status status = state.close(file); !status) return status;
  if (Status status = names ? names() : Status(); !status) return status;
  const auto whole = state.file.finish();
  return whole ? Status() : Status(whole.error());
}

Status ManifestWriter::finish_elsewhere(const std::function<Status()>& take) {
  State& state = *state_;
  if (Status status = state.close({}); !status) return status;
  if (Status status = take(); !status) return status;
  state.file.discard();
  return {};
}

void ManifestWriter::discard() { state_->file.discard(); }

// --- Reads manifests, line by line: a hundred thousand layers cost their records and no document tree.

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
  if (record.layer.index != index) return fmt::format("has layer {} where layer {} is expected", record.layer.index, index);
  for (const std::string& what : {what_is_impossible(record.layer), what_is_impossible(record.program)}) {
    if (!what.empty()) return fmt::format("layer {}: {}", index, what);
  }
  if (head.product != Product::kImages) record.paths = std::make_shared<const PathFacts>(paths);
  if (head.max_drops == 1) record.max_drops = record.drops > 0 ? 1 : 0;
  for (const ImageRecord& image : record.images) {
    record.bytes += image.bytes;
    if (head.drops_of_materials()) continue;
    record.set_pixels += head.materials.empty() && record.set_pixels > 0 ? 0 : image.set_pixels;  // drops fall on the same
    if (head.materials.empty() && image.set_pixels > 0) ++record.max_drops;
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

Result<ImagesOnRecord> images_on_record(const std::string& path) {
  ImagesOnRecord reported{path, 0, 0, {}, 0};
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return reported;
  std::string manifest = path + "/manifest.json";
  if (product_of_manifest(manifest) == Product::kImages) {
    const std::string pages = pages_path(path);
    reported.path = pages.empty() ? path + "/layers" : pages;
  } else {
    manifest = (fs::path(path).lexically_normal() / "../manifest.json").string();
    if (!fs::equivalent(path, fs::path(path) / "../layers", ignored) || product_of_manifest(manifest) != Product::kImages)
      return reported;
  }
  const auto read = read_manifest(manifest);
  if (!read || read->layers.empty()) return reported;
  if (read->head.grey_drops()) {
    return Error{Fault::kInput,
                 fmt::format("{}: its images are drops of a pixel as grey, which are no fill fractions; plan its "
                             "parts again, or copy the images into a folder of their own",
                             one_line(manifest))};
  }
  if (read->head.named_images() > 0) {
    return Error{Fault::kInput,
                 fmt::format("{}: has several images a layer, of drops or materials; plan its parts again, or name a "
                             "folder with one image a layer",
                             one_line(manifest))};
  }
  const Layer first = read->layers.front().layer;
  reported.bottom = first.bottom;
  reported.thickness = first.thickness;
  reported.mirror = read->head.mirror;
  reported.levels = read->head.full_level() > 0 ? read->head.levels : 0;
  reported.geometry = read->head.geometry;
  for (const LayerRecord& record : read->layers) {
    if (record.layer.thickness == first.thickness) continue;
    return Error{Fault::kInput,
                 fmt::format("{}: layer {} is {} mm thick, the first one {} mm; images as parts are layers of one thickness",
                             one_line(manifest), record.layer.index, mm(record.layer.thickness), mm(first.thickness))};
  }
  return reported;
}

std::string manifest_of_layer(const std::string& image) {
  const fs::path manifest = fs::path(image).parent_path() / "../manifest.json";
  return is_file(manifest.string()) ? manifest.string() : manifest.lexically_normal().string();
}

bool are_grey_drops(const std::string& image) {
  const std::string manifest = manifest_of_layer(image);
  if (product_of_manifest(manifest) != Product::kImages) return false;
  const auto read = read_manifest(manifest);
  return read && read->head.grey_drops();
}

}  // namespace lamina
