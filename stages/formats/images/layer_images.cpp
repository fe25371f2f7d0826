#include "stages/formats/images/layer_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "stages/data/shortage.h"
#include "stages/formats/images/image.h"
#include "stages/formats/images/image_order.h"
#include "stages/support/hash/hash.h"
#include "stages/support/text/readable.h"

namespace lamina::formats {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxLayers = 1 << 24;
constexpr std::string_view kReadEndings[] = {".png", ".tif", ".tiff", ".pbm", ".pgm", ".bmp"};
constexpr std::string_view kUnreadEndings[] = {".jpg", ".jpeg", ".gif", ".webp", ".tga", ".jp2", ".ppm"};

}  // namespace

bool names_images(const std::string& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored) ||
         std::ranges::find(kReadEndings, lower_case(fs::path(path).extension().string())) != std::end(kReadEndings);
}

Result<std::vector<Numbered>> numbered_images(const std::string& folder, bool gaps) {
  std::vector<Numbered> images;
  std::string nested;  // the first folder in it
  std::error_code wrong;
  // A range-based loop would throw where reading goes wrong on the way.
  for (fs::directory_iterator entry(folder, wrong); !wrong && entry != fs::directory_iterator(); entry.increment(wrong)) {
    const fs::path& path = entry->path();
    const std::string ending = lower_case(path.extension().string()), stem = path.stem().string();
    if (stem.starts_with('.')) continue;  // files of other systems next to images: ._0001.tif
    std::error_code ignored;
    if (entry->is_directory(ignored)) {
      nested = nested.empty() ? path.string() : std::min(nested, path.string());
      continue;
    }
    const bool is_read = std::ranges::find(kReadEndings, ending) != std::end(kReadEndings);
    if (!is_read && std::ranges::find(kUnreadEndings, ending) == std::end(kUnreadEndings)) continue;
    const std::size_t last = stem.find_last_of("0123456789");
    const std::size_t before = last == std::string::npos ? last : stem.find_last_not_of("0123456789", last);
    if (!is_read) {
      if (last == std::string::npos) continue;
      return Error{Fault::kInput, fmt::format("{}: is of a format that is not read; bring the images to PNG, TIFF, BMP or PBM",
                                              one_line(path.string()))};
    }
    const std::string digits = last == std::string::npos ? "" : stem.substr(before + 1, last - before);
    if (digits.empty() || digits.size() > 18)
      return Error{Fault::kInput,
                   fmt::format("{}: has no layer number in its name; rename it as a0001.png, or move it elsewhere",
                               one_line(path.string()))};
    images.push_back({std::stoull(digits), path.string()});
  }
  if (is_shortage(wrong.value())) return shortage(wrong.value(), one_line(folder));
  if (wrong) return Error{Fault::kInput, fmt::format("{}: the folder cannot be read: {}", one_line(folder), wrong.message())};
  if (images.empty() && !nested.empty())
    return Error{Fault::kInput, fmt::format("{}: contains no images, only folders; give one of them, as {}", one_line(folder),
                                            one_line(nested))};
  if (images.empty())
    return Error{
        Fault::kInput,
        fmt::format("{}: contains neither manifest.json of lamina jet nor images .png, .tif, .bmp or .pbm", one_line(folder))};
  const auto steps = sort_images(folder, images);
  if (!steps) return steps.error();
  for (std::size_t i = 1; i < images.size(); ++i) {
    if (images[i].number == images[i - 1].number + 1 || (gaps && images[i].number != images[i - 1].number)) continue;
    if (images[i].number == images[i - 1].number)
      return Error{Fault::kInput, fmt::format("{}: has the number of {}; a layer is one image", one_line(images[i].path),
                                              one_line(fs::path(images[i - 1].path).filename().string()))};
    return Error{Fault::kInput, fmt::format("{}: {} is missing before it; add that image, or renumber the images",
                                            one_line(images[i].path), steps->name_of(images[i - 1].number + 1))};
  }
  return images;
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
    if (!digest) return of_input(digest.error());
    const auto positions = pages_of(file.path);
    if (!positions) return positions.error();
    if (folder && positions->size() > 1)
      return Error{Fault::kInput, fmt::format("{}: contains {} images; give the file itself, or write one image per file",
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
  auto first = dark_pixels(stack.files_.front(), request.threshold, stack.pages_.front().position, Keep::kCounts);
  if (!first) return first.error();
  stack.columns_ = first->columns;
  stack.rows_ = first->rows;
  // A resolution that no printer has is none.
  const auto sound = [](double dpi) { return dpi >= 1 && dpi <= 25'400; };
  if (!sound(first->dpi_x) || !sound(first->dpi_y)) first->dpi_x = first->dpi_y = 0;
  stack.dpi_x_ = first->dpi_x;
  stack.dpi_y_ = first->dpi_y;
  if (Status status = stack.inspect_others(first->counts.changes); !status) return status.error();
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
    const auto image = read(layer, Keep::kCounts);
    if (!image) return image.error();
    add(layer, image->counts.changes);
  }
  return {};
}

std::uint64_t LayerImages::expected_changes(std::uint32_t layer) const {
  const std::uint64_t maximum = std::uint64_t{rows_} * (std::uint64_t{columns_} + 2);
  const double expected = 2 * changes_a_byte_ * static_cast<double>(pages_[layer].bytes + 512);
  return pages_[layer].file == UINT32_MAX ? 0 : std::min(maximum, static_cast<std::uint64_t>(expected));
}

std::uint64_t LayerImages::expected_bytes(std::uint32_t layer) const {
  // Runs that grow are held twice; above half of the bits they become those (geometry/bits.h).
  return std::min(16 * expected_changes(layer), 2 * bytes_of_bits(columns_, rows_)) + 8 * std::uint64_t{rows_};
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
  auto image = read(layer, Keep::kRuns);
  if (!image) return image.error();
  return std::move(image->runs);
}

Result<Image> LayerImages::read(std::uint32_t layer, Keep keep) const {
  const Page& page = pages_[layer];
  if (page.file == UINT32_MAX) {
    Image empty;
    empty.columns = empty.runs.columns = columns_;
    empty.rows = rows_;
    empty.runs.row_offset.assign(std::size_t{rows_} + 1, 0);
    return empty;
  }
  auto image = dark_pixels(files_[page.file], request_.threshold, page.position, keep);
  if (Status status = check_stamp(page.file); !status) return status.error();
  if (!image) return image.error();
  if (Status status = check(layer, *image, image->columns, image->rows); !status) return status.error();
  if (!request_.invert || keep == Keep::kCounts) return image;
  if (image->bits) {
    invert(*image->bits);
  } else {
    image->runs = inverse(image->runs);
  }
  return image;
}

Result<Levels> LayerImages::levels(std::uint32_t layer, std::uint8_t full) const {
  Levels read;
  const auto image = levels(layer, full, read, Keep::kRuns);
  if (!image) return image.error();
  return read;
}

Result<Image> LayerImages::levels(std::uint32_t layer, std::uint8_t full, Levels& levels, Keep keep) const {
  const Page& page = pages_[layer];
  if (page.file == UINT32_MAX) {
    levels.start(columns_);
    levels.row_offset.assign(std::size_t{rows_} + 1, 0);
    return Image();
  }
  auto image = nearest_levels(files_[page.file], {full, request_.invert, page.position}, levels, keep);
  if (Status status = check_stamp(page.file); !status) return status.error();
  if (!image) return image.error();
  if (Status status = check(layer, *image, image->columns, image->rows); !status) return status.error();
  return image;
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
