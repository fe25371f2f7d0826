#include "stages/formats/tiff/tags.h"

#include <fmt/format.h>

#include "stages/geometry/bits.h"
#include "stages/support/text/decimal.h"

namespace lamina::write::tiff {

Error cannot_hold(std::uint32_t columns, std::uint32_t rows, std::string_view why) {
  return {Fault::kOutput, fmt::format("TIFF cannot hold a layer of {} x {} pixels: {}", columns, rows, why)};
}

Status check_size(std::uint32_t columns, std::uint32_t rows) {
  if (columns == 0 || rows == 0) return cannot_hold(columns, rows, "it has no pixels");
  if (columns > kMostPixelsASide || rows > kMostPixelsASide) {
    return cannot_hold(columns, rows, fmt::format("a side has at most {} pixels", kMostPixelsASide));
  }
  return {};
}

void set_tags(TIFF* tiff, const Frame& frame, std::uint16_t bits, std::uint16_t compression, std::uint32_t rows_per_strip) {
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, frame.columns);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, frame.rows);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, static_cast<int>(bits));
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, static_cast<int>(compression));
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE);
  TIFFSetField(tiff, TIFFTAG_FILLORDER, FILLORDER_MSB2LSB);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, rows_per_strip);
  TIFFSetField(tiff, TIFFTAG_XRESOLUTION, frame.dpi_x);
  TIFFSetField(tiff, TIFFTAG_YRESOLUTION, frame.dpi_y);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_RESOLUTIONUNIT, RESUNIT_INCH);
  TIFFSetField(tiff, TIFFTAG_SOFTWARE, "lamina");  // without a version: releases do not change the bytes of layers
}

Status finish(TiffHandle tiff, bool strips_written, MemoryFile& memory, const Frame& frame, const std::string& message) {
  const bool directory_written = strips_written && TIFFFlush(tiff.get()) != 0;
  tiff.reset();
  if (!directory_written) {
    if (memory.position > kMostClassicBytes - kStripBytes - kDirectoryBytes) {
      return cannot_hold(frame.columns, frame.rows, "the file would exceed 4 GiB; use --format tiff-g4");
    }
    return cannot_hold(frame.columns, frame.rows, message.empty() ? "out of memory" : message);
  }
  memory.bytes.resize(memory.size);
  return {};
}

void LayerText::take(const LayerTags& tags) {
  constexpr std::size_t kLongestTitle = 128;
  char bottom[kMostDecimal], top[kMostDecimal];
  *put_mm(tags.bottom, bottom) = *put_mm(tags.top, top) = 0;
  const std::string_view title = std::string_view(tags.title).substr(0, kLongestTitle);
  const auto put =
      fmt::format_to_n(text_, sizeof text_ - 1, "{}{}layer {} of {}, z {} to {} mm{}{}{}{}", title, title.empty() ? "" : ", ",
                       tags.layer + 1, tags.layers, bottom, top, tags.material.empty() ? "" : ", ", tags.material,
                       tags.mirror.empty() ? "" : ", mirrored in ", tags.mirror);
  for (char* c = text_; c != put.out; ++c) *c = *c >= ' ' && *c <= '~' ? *c : '?';  // 7-bit ASCII, TIFF 6.0 section 2
  *put.out = 0;
  page_ = tags.layer;
  pages_ = tags.layers;
}

void LayerText::put(TIFF* tiff) const {
  if (pages_ == 0) return;
  TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, text_);
  if (pages_ <= UINT16_MAX) TIFFSetField(tiff, TIFFTAG_PAGENUMBER, static_cast<int>(page_), static_cast<int>(pages_));
}

}  // namespace lamina::write::tiff
