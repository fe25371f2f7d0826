#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "stages/data/units.h"
#include "stages/geometry/bits.h"
#include "stages/write/decimal.h"
#include "stages/write/g4/encode.h"
#include "stages/write/tiff/ending.h"
#include "stages/write/tiff/memory_file.h"
#include "stages/write/tiff/tiff.h"

namespace lamina::write::tiff {
namespace {

// libtiff's header of a classic TIFF. The first strip follows it.
constexpr std::size_t kHeaderBytes = 8;
// Room for the directory and what it points to, so that libtiff's last writes do not grow the buffer.
constexpr std::size_t kDirectoryBytes = 1024;
// A strip of bits is at most this long, unless a row is longer: it stays in the second-level cache between being
// filled and being read, and a reader needs no more memory than that.
constexpr std::size_t kStripBytes = 256 * 1024;

Error cannot_hold(const RunsView& runs, std::string_view why) {
  return {Fault::kOutput, fmt::format("TIFF cannot hold a layer of {} x {} pixels: {}", runs.columns, runs.rows(), why)};
}

Status check_size(const RunsView& runs) {
  if (runs.columns == 0 || runs.rows() == 0) return cannot_hold(runs, "it has no pixels");
  if (runs.columns > kMostPixelsASide || runs.rows() > kMostPixelsASide) {
    return cannot_hold(runs, fmt::format("a side has at most {} pixels", kMostPixelsASide));
  }
  return {};
}

void set_tags(TIFF* tiff, const RunsView& runs, double dpi_x, double dpi_y, std::uint16_t compression,
              std::uint32_t rows_per_strip) {
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, runs.columns);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, runs.rows());
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 1);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, static_cast<int>(compression));
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE);
  TIFFSetField(tiff, TIFFTAG_FILLORDER, FILLORDER_MSB2LSB);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, rows_per_strip);
  TIFFSetField(tiff, TIFFTAG_XRESOLUTION, dpi_x);
  TIFFSetField(tiff, TIFFTAG_YRESOLUTION, dpi_y);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_RESOLUTIONUNIT, RESUNIT_INCH);
  TIFFSetField(tiff, TIFFTAG_SOFTWARE, "lamina");  // without a version: releases do not change the bytes of layers
}

/// Keeps what files say of their layers, without an allocation a layer.
class TiffEncoder : public ImageEncoder {
 public:
  void tag(const LayerTags& tags) override {
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

 protected:
  bool tagged() const { return pages_ != 0; }
  void set_layer_tags(TIFF* tiff) const {
    if (pages_ == 0) return;
    TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, text_);
    if (pages_ <= UINT16_MAX) TIFFSetField(tiff, TIFFTAG_PAGENUMBER, static_cast<int>(page_), static_cast<int>(pages_));
  }

 private:
  char text_[256] = "";
  std::uint32_t page_ = 0, pages_ = 0;
};

/// Writes the directory; after this the file is whole or the error says why not.
Status finish(TiffHandle tiff, bool strips_written, MemoryFile& memory, const RunsView& runs, const std::string& message) {
  const bool directory_written = strips_written && TIFFFlush(tiff.get()) != 0;
  tiff.reset();
  if (!directory_written) {
    if (memory.position > kMostClassicBytes - kStripBytes - kDirectoryBytes) {
      return cannot_hold(runs, "the file would exceed 4 GiB; use --format tiff-g4");
    }
    return cannot_hold(runs, message.empty() ? "out of memory" : message);
  }
  memory.bytes.resize(memory.size);
  return {};
}

class G4Encoder : public TiffEncoder {
 public:
  void use(Isa isa) override { encoder_ = g4::Encoder(isa); }

  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size(runs); !status) return status;
    file.resize(file.capacity());
    const std::size_t end = encoder_.encode(runs, file, kHeaderBytes);
    if (end > kMostClassicBytes - kDirectoryBytes) return cannot_hold(runs, "the file would exceed 4 GiB");
    const Ending::Image image{runs.columns, runs.rows(), dpi_x, dpi_y, end - kHeaderBytes > UINT16_MAX};
    if (!tagged() && ending_.put(image, end, file)) return {};
    if (file.size() < end + kDirectoryBytes) file.resize(end + kDirectoryBytes);

    MemoryFile memory{file};
    std::string message;
    TiffHandle tiff = open_for_writing(memory, message);
    if (tiff == nullptr) return cannot_hold(runs, message);
    set_tags(tiff.get(), runs, dpi_x, dpi_y, COMPRESSION_CCITTFAX4, runs.rows());
    set_layer_tags(tiff.get());
    const auto length = static_cast<tmsize_t>(end - kHeaderBytes);
    const bool written = TIFFWriteRawStrip(tiff.get(), 0, file.data() + kHeaderBytes, length) == length;
    Status status = finish(std::move(tiff), written, memory, runs, message);
    if (status && !tagged()) ending_.take(image, file, end);
    return status;
  }

 private:
  g4::Encoder encoder_;
  Ending ending_;  // of the layer before
};

class StripEncoder : public TiffEncoder {
 public:
  explicit StripEncoder(std::uint16_t compression) : compression_(compression) {}

  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size(runs); !status) return status;
    const std::size_t stride = row_bytes(runs.columns);
    if (compression_ == COMPRESSION_NONE && stride * runs.rows() > kMostClassicBytes - kStripBytes) {
      return cannot_hold(runs, "the file would exceed 4 GiB; use --format tiff-g4");
    }
    const auto rows_per_strip = static_cast<std::uint32_t>(std::clamp<std::size_t>(kStripBytes / stride, 1, runs.rows()));
    if (compression_ == COMPRESSION_NONE) {  // its size is known: nothing has to grow, and no second copy exists meanwhile
      const std::size_t strips = ceil_div<std::size_t>(runs.rows(), rows_per_strip);
      file.clear();
      file.reserve(kHeaderBytes + stride * runs.rows() + kDirectoryBytes + strips * 2 * sizeof(std::uint32_t));
    }
    file.resize(file.capacity());
    MemoryFile memory{file};
    std::string message;
    TiffHandle tiff = open_for_writing(memory, message);
    if (tiff == nullptr) return cannot_hold(runs, message);
    set_tags(tiff.get(), runs, dpi_x, dpi_y, compression_, rows_per_strip);
    set_layer_tags(tiff.get());

    bool written = true;
    bits_.resize(stride * rows_per_strip);
    for (std::uint32_t first = 0, strip = 0; first < runs.rows() && written; first += rows_per_strip, ++strip) {
      const std::uint32_t rows = std::min(rows_per_strip, runs.rows() - first);
      for (std::uint32_t r = 0; r < rows; ++r) {
        expand_row(runs.row(first + r), std::span(bits_).subspan(stride * r, stride));
      }
      const auto length = static_cast<tmsize_t>(stride * rows);
      written = compression_ == COMPRESSION_NONE ? TIFFWriteRawStrip(tiff.get(), strip, bits_.data(), length) == length
                                                 : TIFFWriteEncodedStrip(tiff.get(), strip, bits_.data(), length) == length;
    }
    return finish(std::move(tiff), written, memory, runs, message);
  }

 private:
  std::uint16_t compression_;
  Bytes bits_;  // of one strip
};

}  // namespace

std::unique_ptr<ImageEncoder> make_g4_encoder() { return std::make_unique<G4Encoder>(); }
std::unique_ptr<ImageEncoder> make_packbits_encoder() { return std::make_unique<StripEncoder>(COMPRESSION_PACKBITS); }
std::unique_ptr<ImageEncoder> make_uncompressed_encoder() { return std::make_unique<StripEncoder>(COMPRESSION_NONE); }

}  // namespace lamina::write::tiff
