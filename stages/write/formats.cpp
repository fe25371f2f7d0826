#include <algorithm>
#include <array>

#include "stages/write/image_format.h"
#include "stages/write/null/null.h"
#include "stages/write/pbm/pbm.h"
#include "stages/write/png/png_format.h"
#include "stages/write/tiff/tiff.h"

namespace lamina::write {
namespace {

constexpr std::array<ImageFormat, 6> kFormats = {{
    {"tiff-g4", ".tif", "TIFF, CCITT Group 4: small and fast, read by every RIP", tiff::make_g4_encoder},
    {"tiff-packbits", ".tif", "TIFF, PackBits: for readers without CCITT", tiff::make_packbits_encoder},
    {"tiff-none", ".tif", "TIFF, uncompressed", tiff::make_uncompressed_encoder},
    {"png", ".png", "PNG, 1 bit", png::make_encoder},
    {"pbm", ".pbm", "portable bitmap, uncompressed", pbm::make_encoder},
    {"null", "", "no image files: for timing", null::make_encoder},
}};

}  // namespace

std::span<const ImageFormat> image_formats() { return kFormats; }

const ImageFormat* find_image_format(std::string_view id) {
  const auto found = std::find_if(kFormats.begin(), kFormats.end(), [&](const ImageFormat& f) { return f.id == id; });
  return found == kFormats.end() ? nullptr : &*found;
}

}  // namespace lamina::write
