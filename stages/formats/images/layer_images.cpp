#include "stages/formats/images/layer_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "stages/formats/images/image.h"
#include "stages/formats/images/numbered.h"
#include "stages/support/hash/hash.h"
#include "stages/support/text/readable.h"

namespace lamina::formats {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxLayers = 1 << 24;

}  // namespace

bool names_images(const std::string& path) {
  constexpr std::string_view kEndings[] = {".tif", ".tiff", ".png", ".bmp", ".pbm", ".pgm"};
  std::error_code ignored;
  return fs::is_directory(path, ignored) ||
         std::ranges::find(kEndings, lower_case(fs::path(path).extension().string())) != std::end(kEndings);
}

Result<LayerImages> LayerImages::open(const std::string& path, const LayerImagesRequest& request) {
  LayerImages stack;
  stack.request_ = request;
  std::error_code ignored;
  std::vector<Numbered> files{{0, path}};
  const bool folder = fs::is_directory(path, ignored);
  if (folder) {
    auto found = numbered_images(path, request.missing_empty);
    if (!found) return found.error();
    files = std::move(*found);
    if (files.back().number - files.front().number >= kMaxLayers)
      return Error{Fault::kInput, fmt::format("{}: its number is {} above the first one; number the images anew",
                                              one_line(files.back().path), files.back().number - files.front().number)};
  }
  stack.first_number_ = files.front().number;
  std::string all = fmt::format("{} {}", request.threshold, request.invert);
  for (Numbered& file : files) {
    stack.stamps_.push_back(stamp_of(file.path));
    const auto digest = digest_file(file.path);
    if (!digest) return Error{Fault::kInput, digest.error().message};
    const auto positions = pages_of(file.path);
    if (!positions) return positions.error();
    if (folder && positions->size() > 1)
      return Error{Fault::kInput, fmt::format("{}: holds {} images; name the file itself, or write one image a file",
                                              one_line(file.path), positions->size())};
    while (folder && stack.pages_.size() < file.number - stack.first_number_) {
      stack.pages_.emplace_back();
      ++stack.missing_;
    }
    all += fmt::format(" {} {}", stack.pages_.size(), hex(digest->hash));
    for (const std::uint64_t position : *positions)
      stack.pages_.push_back({static_cast<std::uint32_t>(stack.files_.size()), position, digest->bytes / positions->size()});
    stack.files_.push_back(std::move(file.path));
  }
  stack.fingerprint_ = hash_text(all).low;
  auto first = dark_pixels(stack.files_.front(), request.threshold, stack.pages_.front().position);
  if (!first) return first.error();
  stack.columns_ = first->runs.columns;
  stack.rows_ = first->runs.view().rows();
  // A resolution that no printer has is none.
  const auto sound = [](double dpi) { return dpi >= 1 && dpi <= 25'400; };
  if (!sound(first->dpi_x) || !sound(first->dpi_y)) first->dpi_x = first->dpi_y = 0;
  stack.dpi_x_ = first->dpi_x;
  stack.dpi_y_ = first->dpi_y;
  if (Status status = stack.inspect_others(first->runs.change.size()); !status) return status.error();
  return stack;
}

Status LayerImages::inspect_others(std::uint64_t changes_of_first) {
  const auto add = [&](std::uint32_t layer, std::uint64_t changes) {
    // The bytes of a file other than its pixels do not count.
    changes_a_byte_ = std::max(changes_a_byte_, static_cast<double>(changes) / static_cast<double>(pages_[layer].bytes + 512));
  };
  add(0, changes_of_first);
  for (std::uint32_t inspection = 1; inspection < request_.inspections; ++inspection) {
    const auto layer = static_cast<std::uint32_t>(std::uint64_t{inspection} * (layers() - 1) / (request_.inspections - 1));
    if (layer == 0 || pages_[layer].file == UINT32_MAX) continue;
    const auto image = read(layer);
    if (!image) return image.error();
    add(layer, image->change.size());
  }
  return {};
}

std::uint64_t LayerImages::expected_changes(std::uint32_t layer) const {
  const std::uint64_t maximum = std::uint64_t{rows_} * (std::uint64_t{columns_} + 2);
  const double expected = 2 * changes_a_byte_ * static_cast<double>(pages_[layer].bytes + 512);
  return pages_[layer].file == UINT32_MAX ? 0 : std::min(maximum, static_cast<std::uint64_t>(expected));
}

LayerImages::Stamp LayerImages::stamp_of(const std::string& path) {
  std::error_code ignored;
  const std::uintmax_t bytes = fs::file_size(path, ignored);
  return {bytes, fs::last_write_time(path, ignored).time_since_epoch().count()};
}

std::string_view LayerImages::file(std::uint32_t layer) const {
  return pages_[layer].file == UINT32_MAX ? std::string_view() : files_[pages_[layer].file];
}

Result<Runs> LayerImages::read(std::uint32_t layer) const {
  const Page& page = pages_[layer];
  if (page.file == UINT32_MAX) {
    Runs empty;
    empty.columns = columns_;
    empty.row_offset.assign(std::size_t{rows_} + 1, 0);
    return empty;
  }
  auto image = dark_pixels(files_[page.file], request_.threshold, page.position);
  if (Status status = check_stamp(page.file); !status) return status.error();
  if (!image) return image.error();
  if (Status status = check(layer, *image, image->runs.columns, image->runs.view().rows()); !status) return status.error();
  return request_.invert ? inverse(image->runs) : std::move(image->runs);
}

Result<Levels> LayerImages::levels(std::uint32_t layer, std::uint8_t full) const {
  const Page& page = pages_[layer];
  Levels levels;
  if (page.file == UINT32_MAX) {
    levels.start(columns_);
    levels.row_offset.assign(std::size_t{rows_} + 1, 0);
    return levels;
  }
  const auto image = nearest_levels(files_[page.file], {full, request_.invert, page.position}, levels);
  if (Status status = check_stamp(page.file); !status) return status.error();
  if (!image) return image.error();
  if (Status status = check(layer, *image, levels.columns, levels.view().rows()); !status) return status.error();
  return levels;
}

Status LayerImages::check_stamp(std::uint32_t file) const {
  const std::string& path = files_[file];
  if (stamp_of(path) == stamps_[file]) return {};
  return Error{Fault::kInput, fmt::format("{}: was changed while the job ran; start again with --overwrite", one_line(path))};
}

Status LayerImages::check(std::uint32_t layer, const Image& image, std::uint32_t columns, std::uint32_t rows) const {
  const Page& page = pages_[layer];
  const std::string path = one_line(files_[page.file]);
  const std::string where = page.position == 0 ? path : fmt::format("{}: page {}", path, layer);
  if (columns != columns_ || rows != rows_)
    return Error{Fault::kInput, fmt::format("{}: {} x {} pixels, the first image has {} x {}; bring them to one size", where,
                                            columns, rows, columns_, rows_)};
  if (dpi_x_ > 0 && (std::abs(image.dpi_x - dpi_x_) > 0.05 || std::abs(image.dpi_y - dpi_y_) > 0.05))
    return Error{Fault::kInput, fmt::format("{}: {:g} x {:g} dpi, the first image has {:g} x {:g}; bring them to one", where,
                                            image.dpi_x, image.dpi_y, dpi_x_, dpi_y_)};
  return {};
}

}  // namespace lamina::formats
