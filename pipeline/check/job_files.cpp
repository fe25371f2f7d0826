#include "pipeline/check/job_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "pipeline/machine/profiles.h"
#include "pipeline/report/machine_text.h"
#include "stages/data/levels.h"
#include "stages/program/head_grid.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/compressed.h"
#include "stages/support/io/file_reader.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// Empty if it cannot be read: the check of its hash has reported what is missing or differs.
std::string whole_file(const fs::path& path, std::uint64_t max_bytes) {
  auto text = read_file(path.string(), {.max_bytes = max_bytes});
  return text ? std::move(*text) : std::string();
}

/// path  of a file of the job
Error wrong(const std::string& path, std::string_view what) {
  return {Fault::kVerification, fmt::format("{}: {}; run lamina verify for details", path, what)};
}

Error changed(const std::string& path) { return wrong(path, "is not the file of the manifest"); }

}  // namespace

std::string find_part(const std::string& name, const std::vector<std::string>& folders) {
  std::error_code ignored;
  for (const fs::path folder : folders) {
    if (fs::is_regular_file(folder, ignored) && folder.filename() == name) return folder.string();
    if (fs::is_regular_file(folder / name, ignored)) return (folder / name).string();
  }
  return {};
}

Result<replay::VirtualMachine> machine_of_job(const std::string& directory, const ManifestHead& head) {
  const std::string name = "program/machine.toml";
  std::string fault = fault_of_file(directory, name, head.machine_profile);
  if (!fault.empty()) return Error{Fault::kVerification, std::move(fault)};
  const Result<Machine> machine = read_machine(whole_file(fs::path(directory) / name, kMaxTomlBytes), name);
  if (!machine) return machine.error();
  return replay::VirtualMachine::build(*machine, head.grid.columns(), head.grid.rows(), head.layer_count);
}

std::string sweeps_of_job(const std::string& directory, const Manifest& manifest) {
  if (manifest.head.head_drops < 2) return {};
  const auto machine = machine_of_job(directory, manifest.head);
  const auto grid = machine ? program::make_head_grid(machine->profile()) : machine.error();
  if (!grid) return {};
  program::DropSweeps sweeps{std::max(1u, manifest.head.max_drops)};
  for (const LayerRecord& record : manifest.layers) {
    sweeps.added += record.program.added_sweeps;
    sweeps.added_seconds += static_cast<double>(record.program.added_microseconds) / 1e6;
  }
  return program::sweeps_text(machine->profile(), *grid, sweeps);
}

Status check_images(const std::string& directory, const ManifestHead& head, const LayerRecord& record) {
  for (const LayerImageFile& file : layer_images(head, record)) {
    const std::string path = (fs::path(directory) / file.name).string();
    const Result<FileDigest> digest = digest_file(path, file.record.bytes);
    if (!digest) return Error{Fault::kVerification, digest.error().message + "; run lamina verify for details"};
    if (digest->bytes != file.record.bytes || digest->hash != file.record.hash) return changed(path);
  }
  return {};
}

Status check_frame(const std::string& directory, const ManifestHead& head) {
  for (const auto& [stem, hash] : {std::pair{"start", head.program_start}, {"end", head.program_end}}) {
    const std::string fault = fault_of_file(directory, fmt::format("program/{}{}", stem, head.program_extension), hash);
    if (!fault.empty())
      return Error{Fault::kVerification, fmt::format("{}/{}; run lamina verify for details", directory, fault)};
  }
  return {};
}

Result<std::string> program_of_layer(const std::string& directory, const ManifestHead& head, const LayerRecord& record) {
  const std::string path = (fs::path(directory) / program_file_name(record.layer.index, head.program_extension)).string();
  if (!is_file(path)) return wrong(path, "is missing");
  auto text = read_content(path, record.program.bytes);
  if (!text) return Error{Fault::kVerification, text.error().message + "; run lamina verify for details"};
  if (text->size() != record.program.bytes || hash_text(*text) != record.program.hash) return changed(path);
  return text;
}

bool is_one_bit(const ManifestHead& head) {
  return (head.max_drops <= 1 || head.geometry) && head.full_level() == 0 && !head.grey_drops() && head.named_images() == 0;
}

std::uint64_t bytes_to_read(const ManifestHead& head, const LayerRecord& record, Keep keep) {
  constexpr std::uint64_t kRows = 4 << 20, kMaxStrip = 64 << 20;
  const std::uint32_t columns = head.grid.columns(), rows = head.grid.rows();
  if (keep == Keep::kCounts) return kRows + std::min(record.bytes, kMaxStrip);
  // A change has a set pixel and another one at its sides, and takes a bit of a file at least, except in deflate.
  const std::uint64_t all = std::uint64_t{columns} * rows, set = std::min(record.set_pixels, all);
  const std::uint64_t by_file = head.extension == ".png" ? UINT64_MAX : 8 * record.bytes;
  const std::uint64_t changes = std::min({2 * set, 2 * (all - set) + 2 * std::uint64_t{rows}, by_file});
  const std::uint64_t drops = std::max(1u, head.max_drops), runs = 8 * changes * (drops > 1 || head.full_level() > 0 ? 3 : 1);
  const std::uint64_t pixels = keep == Keep::kSmaller ? std::min(runs, 2 * bytes_of_bits(columns, rows)) : runs;
  return kRows + std::min(record.bytes, kMaxStrip) + pixels;
}

std::uint64_t bytes_to_make(const ManifestHead& head, const LayerRecord& record) {
  return 4 * bytes_to_read(head, record);  // with the zones of drops, and what the shell of a core takes to be found
}

Result<formats::Image> read_layer_image(const std::string& path, const ManifestHead& head, LayerPicture& drops, Levels& levels,
                                        Keep keep) {
  const bool grey = head.grey_drops() || head.full_level() > 0;
  if (!grey) return formats::image(path, 0, keep);
  auto image = formats::levels(path, head.full_level(), levels);
  if (!image || !head.grey_drops()) return image;
  if (const std::uint32_t maximum = highest(levels); maximum > head.max_drops) {
    return Error{Fault::kVerification,
                 fmt::format("{}: has pixels of {} drops, the job at most {}", path, maximum, head.max_drops)};
  }
  drops.resize(head.max_drops);
  for (std::uint32_t k = 0; k < head.max_drops; ++k) threshold_levels(levels, static_cast<std::uint8_t>(k + 1), drops[k]);
  return image;
}

raster::DropPlanes planes_of(const ManifestHead& head) {
  return {std::max(1u, head.max_drops), head.levels > 0 && head.drops_of_materials()};
}

Status add_picture(const ManifestHead& head, std::size_t number, Runs&& image, LayerPicture&& drops,
                   raster::DropPlanes& picture) {
  if (!head.grey_drops()) return picture.add(std::move(image), static_cast<std::uint32_t>(number % head.drop_images()));
  Status status;
  for (std::uint32_t drop = 0; drop < drops.size() && status; ++drop) status = picture.add(std::move(drops[drop]), drop);
  return status;
}

Result<LayerPicture> picture_of_layer(const std::string& directory, const ManifestHead& head, const LayerRecord& record,
                                      const ExpectedDrops& expected) {
  raster::DropPlanes picture = planes_of(head);
  const auto files = layer_images(head, record);
  for (std::size_t i = 0; i < files.size(); ++i) {
    LayerPicture drops;
    Levels levels;
    const std::string path = (fs::path(directory) / files[i].name).string();
    auto image = read_layer_image(path, head, drops, levels);
    if (!image) return image.error();
    if (image->runs.columns != head.grid.columns() || image->runs.view().rows() != head.grid.rows())
      return wrong(path, "is not of the manifest's size");
    const Status added = add_picture(head, i, std::move(image->runs), std::move(drops), picture);
    if (!added) return wrong(path, "sets pixels that " + added.error().message);
  }
  if (Status status = expected.apply(record.layer, picture.planes); !status) return wrong(directory, status.error().message);
  return std::move(picture.planes);
}

Result<formats::Image> printed_pixels(const std::string& image) {
  auto dark = formats::dark_pixels(image, are_grey_drops(image) ? 255 : 128);
  const fs::path path = manifest_of_layer(image), job = path.has_parent_path() ? path.parent_path() : ".";
  const auto manifest = dark ? read_manifest(path.string()) : dark.error();
  if (!manifest || !manifest->head.geometry) return dark;
  const std::string name = "layers/" + fs::path(image).filename().string();
  for (const LayerRecord& record : manifest->layers) {
    if (layer_images(manifest->head, record).front().name != name) continue;
    const std::string directory = job.lexically_normal().string();
    if (Status status = check_images(directory, manifest->head, record); !status) return status.error();
    const auto expected = ExpectedDrops::of(directory, manifest->head);
    if (!expected) {
      return Error{Fault::kVerification,
                   (job.lexically_normal() / expected.error().message).string() + "; run lamina verify for details"};
    }
    auto picture = picture_of_layer(directory, manifest->head, record, *expected);
    if (!picture) return picture.error();
    dark->runs = std::move(picture->front());
    break;
  }
  return dark;
}

}  // namespace lamina::pipeline
