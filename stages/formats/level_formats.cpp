#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "stages/formats/level_format.h"
#include "stages/formats/png/png_format.h"
#include "stages/formats/tiff/tiff.h"

namespace lamina::write {
namespace {

constexpr std::uint64_t kRoom = 512 * 1024;  // header, directory, checks, a strip beside the file

/// A packet of two bytes for each 128 equal ones, up to four more around a change.
constexpr std::uint64_t most_grey_packbits(std::uint64_t columns, std::uint64_t rows, std::uint64_t changes) {
  return kRoom + columns + (columns / 64 + 3) * rows + 4 * changes;
}
/// 13 bits for 258 equal bytes, up to 9 and a match of 13 for each end of a run, and a row's filter.
constexpr std::uint64_t most_grey_png(std::uint64_t columns, std::uint64_t rows, std::uint64_t changes) {
  return kRoom + columns + (columns / 128 + 8) * rows + 4 * changes;
}

constexpr std::array<LevelFormat, 3> kLevelFormats = {{
    {"tiff-4", ".tif", "TIFF, 4-bit grey, PackBits: shares of voxels, or a machine's drops", tiff::make_4_bit_encoder,
     most_grey_packbits},
    {"tiff-8", ".tif", "TIFF, 8-bit grey, PackBits: shares of voxels, or a machine's drops", tiff::make_8_bit_encoder,
     most_grey_packbits},
    {"png-8", ".png", "PNG, 8-bit grey: shares of voxels, or a machine's drops", png::make_8_bit_encoder, most_grey_png},
}};

}  // namespace

std::span<const LevelFormat> level_formats() { return kLevelFormats; }

const LevelFormat* find_level_format(std::string_view id) {
  const auto found = std::ranges::find(kLevelFormats, id, &LevelFormat::id);
  return found == kLevelFormats.end() ? nullptr : &*found;
}

std::optional<std::string_view> extension_of(std::string_view id) {
  if (const ImageFormat* format = find_image_format(id)) return format->extension;
  const LevelFormat* format = find_level_format(id);
  return format != nullptr ? std::optional(format->extension) : std::nullopt;
}

}  // namespace lamina::write
