#include "stages/formats/image_format.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "stages/formats/bmp/bmp.h"
#include "stages/formats/pbm/pbm.h"
#include "stages/formats/png/png_format.h"
#include "stages/formats/tiff/tiff.h"
#include "stages/geometry/bits.h"
#include "stages/support/text/readable.h"

namespace lamina::formats {

Error cannot_hold(std::string_view format, std::uint32_t columns, std::uint32_t rows, std::string_view why) {
  return {Fault::kOutput, fmt::format("{} cannot hold a layer of {} x {} pixels: {}", format, columns, rows, why)};
}

Status check_size(std::string_view format, std::uint32_t columns, std::uint32_t rows) {
  if (columns == 0 || rows == 0) return cannot_hold(format, columns, rows, "it has no pixels");
  if (columns > kMaxPixelsASide || rows > kMaxPixelsASide) {
    return cannot_hold(format, columns, rows, fmt::format("a side has at most {} pixels", kMaxPixelsASide));
  }
  return {};
}

namespace {

/// No file at all, for timing what comes before it.
class NullEncoder : public ImageEncoder {
 public:
  Status encode(const RunsView&, double, double, Bytes& file) override { return encode_nothing(file); }
  Status encode(const BitRows&, double, double, Bytes& file) override { return encode_nothing(file); }

 private:
  static Status encode_nothing(Bytes& file) {
    file.clear();
    return {};
  }
};

std::unique_ptr<ImageEncoder> make_null_encoder() { return std::make_unique<NullEncoder>(); }

using Count = std::uint64_t;

constexpr Count kFileOverhead = 4096;  // header, directory, checks

/// A row costs a bit, and a change at most two bits more than half of a horizontal code word of 28 bits each.
constexpr Count max_g4(Count, Count rows, Count changes) { return kFileOverhead + rows + 4 * changes; }
/// Every pixel a bit, rows in whole bytes.
constexpr Count max_bits(Count columns, Count rows, Count) { return kFileOverhead + (columns + 7) / 8 * rows; }
/// The same, with the offset of each strip of 256 KiB (or of a longer row), and one strip of bits in addition to the file.
constexpr Count max_strips(Count columns, Count rows, Count changes) {
  const Count bits = max_bits(columns, rows, changes);
  return bits + bits / 16384 + 256 * 1024 + columns / 8;
}
/// A packet of two bytes for each 128 equal ones; around a change up to two bytes more.
constexpr Count max_packbits(Count columns, Count rows, Count changes) {
  return std::min((columns / 512 + 3) * rows + 4 * changes, (columns / 8 + columns / 1024 + 2) * rows) + kFileOverhead;
}
/// No byte takes more than 13 bits (png/deflate.cpp). White takes at most 5 bits for 258 bytes; a change two bytes of its own
/// and the end and the beginning of equal ones, in its row and in the row below; a row its filter's byte.
constexpr Count max_png(Count columns, Count rows, Count changes) {
  const Count bytes = max_bits(columns, rows, changes) + rows;
  const Count data = std::min(bytes / 256 + 8 * rows + 18 * changes, bytes / 8 * 13);
  return data + data / 4096 + kFileOverhead;
}
/// Rows in whole words of four bytes.
constexpr Count max_bmp(Count columns, Count rows, Count) { return kFileOverhead + (columns + 31) / 32 * 4 * rows; }
constexpr Count max_null(Count, Count, Count) { return 0; }

/// In addition to the file a strip, as literals (EdgeDeflate) or bits, and as deflate (StripCode::bound).
constexpr Count max_deflate(Count columns, Count rows, Count changes) {
  return max_strips(columns, rows, changes) * 5 / 4 + std::min(max_bits(columns, rows, changes) * 4, Count{4} * 1024 * 1024) + 512 * 1024;
}

constexpr std::array<ImageFormat, 8> kFormats = {{
    {"tiff-g4", ".tif", "TIFF, CCITT Group 4: small and fast, read by every RIP", tiff::make_g4_encoder, max_g4},
    {"tiff-deflate", ".tif", "TIFF, deflate: for dithered images", tiff::make_deflate_encoder, max_deflate},
    {"tiff-packbits", ".tif", "TIFF, PackBits: for readers without CCITT", tiff::make_packbits_encoder, max_packbits},
    {"tiff-none", ".tif", "TIFF, uncompressed", tiff::make_uncompressed_encoder, max_strips},
    {"png", ".png", "PNG, 1 bit", png::make_encoder, max_png},
    {"pbm", ".pbm", "portable bitmap, uncompressed", pbm::make_encoder, max_bits},
    {"bmp", ".bmp", "Windows bitmap, 1 bit, uncompressed", bmp::make_encoder, max_bmp},
    {"null", "", "no image files: for timing", make_null_encoder, max_null},
}};

}  // namespace

std::span<const ImageFormat> image_formats() { return kFormats; }

const ImageFormat* find_image_format(std::string_view id) {
  const auto found = std::find_if(kFormats.begin(), kFormats.end(), [&](const ImageFormat& f) { return f.id == id; });
  return found == kFormats.end() ? nullptr : &*found;
}

namespace {

constexpr std::uint64_t kCapacity = 512 * 1024;  // header, directory, checks, a strip in addition to the file

/// A packet of two bytes for each 128 equal ones, up to four more around a change.
constexpr std::uint64_t max_grey_packbits(std::uint64_t columns, std::uint64_t rows, std::uint64_t changes) {
  return kCapacity + columns + (columns / 64 + 3) * rows + 4 * changes;
}
/// 13 bits for 258 equal bytes, up to 9 and a match of 13 for each end of a run, and a row's filter.
constexpr std::uint64_t max_grey_png(std::uint64_t columns, std::uint64_t rows, std::uint64_t changes) {
  return kCapacity + columns + (columns / 128 + 8) * rows + 4 * changes;
}

constexpr std::array<LevelFormat, 3> kLevelFormats = {{
    {"tiff-4", ".tif", "TIFF, 4-bit grey, PackBits: fill fractions of voxels, or a machine's drops", tiff::make_4_bit_encoder,
     max_grey_packbits},
    {"tiff-8", ".tif", "TIFF, 8-bit grey, PackBits: fill fractions of voxels, or a machine's drops", tiff::make_8_bit_encoder,
     max_grey_packbits},
    {"png-8", ".png", "PNG, 8-bit grey: fill fractions of voxels, or a machine's drops", png::make_8_bit_encoder, max_grey_png},
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

std::string unknown_format(std::string_view id) {
  const std::string begin = lower_case(std::string(id.substr(0, 3)));
  std::string like, all;
  const auto add = [&](std::string_view known) {
    if (known == "null") return;
    all += fmt::format("{}{}", all.empty() ? "" : ", ", known);
    if (begin.size() == 3 && known.starts_with(begin)) like += fmt::format("{}{}", like.empty() ? "" : ", ", known);
  };
  for (const ImageFormat& format : kFormats) add(format.id);
  for (const LevelFormat& format : kLevelFormats) add(format.id);
  const std::string nearest = like.substr(0, like.find(','));
  return fmt::format("unknown value '{}'; use one of {}{}", id, like.empty() ? all : like,
                     like.empty() ? "" : fmt::format("; did you mean '{}'?", nearest));
}

}  // namespace lamina::formats
