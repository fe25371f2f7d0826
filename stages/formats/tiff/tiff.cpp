#include "stages/formats/tiff/tiff.h"

#include <fmt/format.h>
#include <tiff.h>

#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/shortage.h"
#include "stages/data/units.h"
#include "stages/formats/g4/decode.h"
#include "stages/formats/g4/encode.h"
#include "stages/formats/images/image_formats.h"
#include "stages/formats/row_encoder.h"
#include "stages/formats/tiff/dither_deflate.h"
#include "stages/formats/tiff/edge_deflate.h"
#include "stages/formats/tiff/input.h"
#include "stages/formats/tiff/packbits.h"
#include "stages/geometry/bits.h"
#include "stages/support/late/tiff.h"
#include "stages/support/text/decimal.h"

namespace lamina::formats::tiff {
namespace {

/// Content is bytes[0 .. size); the buffer may be larger, so that it need not grow with every write.
struct MemoryFile {
  Buffer<std::byte>& bytes;
  std::uint64_t size = 0;
  std::uint64_t position = 0;
};

/// Largest size of a file whose offsets have 32 bits.
constexpr std::uint64_t kMaxClassicBytes = 0xFFFFFFFF;

MemoryFile& file_of(thandle_t handle) { return *static_cast<MemoryFile*>(handle); }

tmsize_t read_nothing(thandle_t, void*, tmsize_t) { return 0; }

tmsize_t write_bytes(thandle_t handle, void* from, tmsize_t count) {
  MemoryFile& file = file_of(handle);
  const std::uint64_t end = file.position + static_cast<std::uint64_t>(count);
  if (end > kMaxClassicBytes) return 0;
  std::byte* to = file.bytes.data() + file.position;
  // Strips that were encoded in the place where libtiff puts them are there already.
  const bool in_place = from == to && end <= file.bytes.size();
  if (!in_place) {
    if (end > file.bytes.size()) {
      try {
        file.bytes.resize(std::max<std::size_t>({end, file.bytes.size() * 2, std::size_t{4096}}));
      } catch (const std::bad_alloc&) {
        return 0;
      }
      to = file.bytes.data() + file.position;
    }
    std::memcpy(to, from, static_cast<std::size_t>(count));
  }
  // libtiff begins its directory at an even offset and skips a byte for that; in a buffer used before, that byte is
  // one of an older image.
  if (file.position > file.size) std::memset(file.bytes.data() + file.size, 0, file.position - file.size);
  file.position = end;
  file.size = std::max(file.size, end);
  return count;
}

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  MemoryFile& file = file_of(handle);
  const std::uint64_t base = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? file.position : file.size;
  file.position = base + offset;
  return file.position;
}

int close_nothing(thandle_t) { return 0; }

toff_t size_of(thandle_t handle) { return file_of(handle).size; }

/// A little-endian classic TIFF to be written into `file`, which must outlive the handle, as must `message`: libtiff's
/// own words on the first thing that goes wrong. nullptr if memory ran out.
TiffHandle open_for_writing(MemoryFile& file, std::string& message) {
  const auto options = strict_tiff_options(message);
  if (options == nullptr) return nullptr;
  return TiffHandle(TIFFClientOpenExt("layer", "wl", &file, read_nothing, write_bytes, seek, close_nothing, size_of, nullptr,
                                      nullptr, options.get()));
}

/// A strip of bits is at most this long, unless a row is longer: it stays in the second-level cache between being
/// filled and being read, and a reader needs no more memory than that.
constexpr std::size_t kStripBytes = 256 * 1024;
constexpr std::size_t kEdgeStripBytes = 1024 * 1024;  // where edges alone are dithered: never made as bits, and a code each
/// Room for the directory and what it points to, so that libtiff's last writes do not grow the buffer.
constexpr std::size_t kDirectoryBytes = 1024;

/// Min-is-white, one sample of so many bits.
struct TagFrame {
  std::uint32_t columns, rows;
  double dpi_x, dpi_y;
  std::uint16_t bits, compression;
  std::size_t stride = (std::size_t{columns} * bits + 7) / 8;
  std::uint32_t rows_per_strip = static_cast<std::uint32_t>(std::clamp<std::size_t>(kStripBytes / stride, 1, rows));
};

Error refused(const TagFrame& frame, std::string_view why) { return cannot_hold("TIFF", frame.columns, frame.rows, why); }

void set_tags(TIFF* tiff, const TagFrame& frame) {
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, frame.columns);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, frame.rows);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, static_cast<int>(frame.bits));
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, static_cast<int>(frame.compression));
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE);
  TIFFSetField(tiff, TIFFTAG_FILLORDER, FILLORDER_MSB2LSB);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, frame.rows_per_strip);
  TIFFSetField(tiff, TIFFTAG_XRESOLUTION, frame.dpi_x);
  TIFFSetField(tiff, TIFFTAG_YRESOLUTION, frame.dpi_y);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_RESOLUTIONUNIT, RESUNIT_INCH);
  TIFFSetField(tiff, TIFFTAG_SOFTWARE, "lamina");  // without a version: releases do not change the bytes of layers
}

/// Keeps what files say of their layers, without an allocation a layer.
class LayerText {
 public:
  void take(const LayerTags& tags) {
    constexpr std::size_t kLongestTitle = 128;
    char bottom[kMaxDecimal], top[kMaxDecimal];
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
  /// Whether there is something to be said.
  bool any() const { return pages_ != 0; }
  void put(TIFF* tiff) const {
    if (pages_ == 0) return;
    TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, text_);
    if (pages_ <= UINT16_MAX) TIFFSetField(tiff, TIFFTAG_PAGENUMBER, static_cast<int>(page_), static_cast<int>(pages_));
  }

 private:
  char text_[256] = "";
  std::uint32_t page_ = 0, pages_ = 0;
};

// The first strip follows the header of a classic TIFF.
constexpr std::size_t kStripAt = 8, kDirectoryAt = 4, kEntryBytes = 12, kMaxTail = 1024;

template <class Number>
Number number_at(std::span<const std::byte> bytes, std::size_t at) {
  Number value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

template <class Number>
void put_at(std::byte* bytes, std::size_t at, Number value) {
  std::memcpy(bytes + at, &value, sizeof value);
}

/// libtiff keeps resolutions as floats: puts decimal dpi into its directory as the fractions that they are.
void put_exact_resolution(const TagFrame& frame, Bytes& file) {
  const std::size_t directory = number_at<std::uint32_t>(file, kDirectoryAt);
  for (std::size_t e = 0; e < number_at<std::uint16_t>(file, directory); ++e) {
    const std::size_t at = directory + 2 + e * kEntryBytes;
    const auto tag = number_at<std::uint16_t>(file, at);
    if (tag != TIFFTAG_XRESOLUTION && tag != TIFFTAG_YRESOLUTION) continue;
    const double dpi = tag == TIFFTAG_XRESOLUTION ? frame.dpi_x : frame.dpi_y;
    if (dpi == std::floor(dpi) || !is_exact_dpi(dpi)) continue;
    const DotPitch exact = pitch_of_dpi(dpi);
    const std::size_t value = number_at<std::uint32_t>(file, at + 8);
    put_at(file.data(), value, static_cast<std::uint32_t>(exact.dots));
    put_at(file.data(), value + 4, static_cast<std::uint32_t>(exact.span / kNmPerInch));
  }
}

/// The whole file of an image. put_strips(TIFF*)  returns false where libtiff does not take them
template <class PutStrips>
Status write_file(Bytes& file, const TagFrame& frame, const LayerText& text, const PutStrips& put_strips) {
  MemoryFile memory{file};
  std::string message;
  errno = 0;
  TiffHandle tiff = open_for_writing(memory, message);
  if (tiff == nullptr) return is_shortage(errno) ? shortage(errno) : refused(frame, message);
  set_tags(tiff.get(), frame);
  text.put(tiff.get());
  const bool written = put_strips(tiff.get()) && TIFFFlush(tiff.get()) != 0;
  tiff.reset();
  if (!written) {
    if (memory.position > kMaxClassicBytes - kStripBytes - kDirectoryBytes) {
      return refused(frame, "the file would exceed 4 GiB; use --format tiff-g4");
    }
    return is_shortage(errno) ? shortage(errno) : refused(frame, message);
  }
  file.resize(memory.size);
  put_exact_resolution(frame, file);
  return {};
}

/// Writes the strips of an image, the bytes that pack(first row, end) compresses. returns  false where libtiff does not take one
template <class Pack>
bool put_packed(TIFF* tiff, const TagFrame& frame, const Pack& pack) {
  for (std::uint32_t row = 0, number = 0; row < frame.rows; ++number) {
    const std::uint32_t end = row + std::min(frame.rows_per_strip, frame.rows - row);
    const std::span<std::byte> strip = pack(row, end);
    const auto length = static_cast<tmsize_t>(strip.size());
    if (TIFFWriteRawStrip(tiff, number, strip.data(), length) != length) return false;
    row = end;
  }
  return true;
}

/// A file with strips of rows that fill(row, bytes) makes. strip  scratch, kept from one image to the next
template <class Fill>
Status write_rows(Bytes& file, const TagFrame& frame, const LayerText& text, Bytes& strip, const Fill& fill) {
  return write_file(file, frame, text, [&](TIFF* tiff) {
    strip.resize(frame.stride * frame.rows_per_strip);
    for (std::uint32_t row = 0, number = 0; row < frame.rows; ++number) {
      const std::uint32_t begin = row, end = row + std::min(frame.rows_per_strip, frame.rows - row);
      for (; row < end; ++row) fill(row, std::span(strip).subspan(frame.stride * (row - begin), frame.stride));
      const auto length = static_cast<tmsize_t>(frame.stride * (end - begin));
      const tmsize_t taken = frame.compression == COMPRESSION_NONE ? TIFFWriteRawStrip(tiff, number, strip.data(), length)
                                                                   : TIFFWriteEncodedStrip(tiff, number, strip.data(), length);
      if (taken != length) return false;
    }
    return true;
  });
}

// --- what stands behind the only strip of a classic TIFF, kept from one layer to the next.
//
// libtiff sorts its table of fields for every file that it opens: some 60 us, which is what a small layer takes to be encoded.
// Layers of a job differ in their strip alone, so libtiff writes the directory of the first one, and those of others are
// copies, moved behind their strips, with the strip's length put in. Layout: TIFF 6.0 (Adobe 1992), section 2.

/// Bytes of a value of a type; 0: no type of TIFF 6.0.
std::size_t bytes_of(std::uint16_t type) {
  constexpr std::array<std::uint8_t, 13> kBytes = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8};
  return type < kBytes.size() ? kBytes[type] : 0;
}

/// libtiff begins what stands behind a strip at an even byte.
std::size_t even(std::size_t at) { return (at + 1) & ~std::size_t{1}; }

class Ending {
 public:
  /// What decides the directory, but for the length of the strip: lengths of 16 and of 32 bits are different fields.
  struct TiffLayout {
    std::uint32_t columns = 0, rows = 0;
    double dpi_x = 0, dpi_y = 0;
    bool long_strip = false;
    bool operator==(const TiffLayout&) const = default;
  };

  /// Keeps the ending of a whole file, as libtiff wrote it, whose strip ends at `strip_end`. Keeps nothing of a file with
  /// another layout than one strip from byte 8 on and all else after it.
  void take(const TiffLayout& image, std::span<const std::byte> file, std::size_t strip_end) {
    tail_.clear();
    if (!find_fields(file, strip_end)) return;
    image_ = image;
    head_.assign(file.begin(), file.begin() + kStripAt);
    tail_.assign(file.begin() + static_cast<std::ptrdiff_t>(tail_at_), file.end());
  }

  /// Ends another file, whose strip stands from byte 8 to `strip_end`. returns  false if no ending of such an image is kept
  bool put(const TiffLayout& image, std::size_t strip_end, Bytes& file) const {
    if (tail_.empty() || !(image == image_)) return false;
    const std::size_t begin = even(strip_end);
    file.resize(begin + tail_.size());
    if (begin != strip_end) file[strip_end] = std::byte{0};
    std::byte* const tail = file.data() + begin;
    std::memcpy(file.data(), head_.data(), head_.size());
    std::memcpy(tail, tail_.data(), tail_.size());
    const auto moved = [&](std::byte* bytes, std::size_t at) {
      std::uint32_t offset = 0;
      std::memcpy(&offset, bytes + at, sizeof offset);
      put_at(bytes, at, static_cast<std::uint32_t>(offset - tail_at_ + begin));
    };
    moved(file.data(), kDirectoryAt);
    for (const std::size_t position : offsets_) moved(tail, position);
    const std::size_t length = strip_end - kStripAt;
    if (short_length_) {
      put_at(tail, length_at_, static_cast<std::uint16_t>(length));
    } else {
      put_at(tail, length_at_, static_cast<std::uint32_t>(length));
    }
    return true;
  }

 private:
  bool find_fields(std::span<const std::byte> file, std::size_t strip_end) {
    tail_at_ = even(strip_end);
    if (file.size() < tail_at_ + 2 || file.size() > tail_at_ + kMaxTail) return false;
    const std::size_t directory = number_at<std::uint32_t>(file, kDirectoryAt);
    if (directory < tail_at_ || directory + 2 > file.size()) return false;
    const std::size_t entries = number_at<std::uint16_t>(file, directory);
    if (directory + 2 + entries * kEntryBytes > file.size()) return false;
    offsets_.clear();
    length_at_ = 0;
    for (std::size_t e = 0; e < entries; ++e) {
      const std::size_t at = directory + 2 + e * kEntryBytes, value = at + 8;
      const auto tag = number_at<std::uint16_t>(file, at), type = number_at<std::uint16_t>(file, at + 2);
      const std::size_t bytes = bytes_of(type) * number_at<std::uint32_t>(file, at + 4);
      if (bytes == 0) return false;
      if (tag == TIFFTAG_STRIPBYTECOUNTS) {
        if (type != TIFF_SHORT && type != TIFF_LONG) return false;
        length_at_ = value - tail_at_;
        short_length_ = type == TIFF_SHORT;
      } else if (bytes > 4) {
        const std::size_t offset = number_at<std::uint32_t>(file, value);
        if (offset < tail_at_ || offset + bytes > file.size()) return false;
        offsets_.push_back(value - tail_at_);
      }
      if ((tag == TIFFTAG_STRIPBYTECOUNTS || tag == TIFFTAG_STRIPOFFSETS) && bytes > 4) return false;
    }
    return length_at_ != 0;
  }

  TiffLayout image_;
  std::vector<std::byte> head_, tail_;  // before and behind the strip
  std::vector<std::size_t> offsets_;    // in tail_, of 32-bit offsets into the file
  std::size_t tail_at_ = 0;             // where it stood
  std::size_t length_at_ = 0;           // in tail_, of the strip's length
  bool short_length_ = false;           // of 16 bits
};

class G4Encoder : public ImageEncoder {
 public:
  void tag(const LayerTags& tags) override { text_.take(tags); }
  void use(Isa isa) override { encoder_ = g4::Encoder(isa); }

  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    return encode_image(runs, runs.columns, runs.rows(), {dpi_x, dpi_y}, file);
  }
  Status encode(const BitRows& rows, double dpi_x, double dpi_y, Bytes& file) override {
    return encode_image(rows, rows.columns(), rows.rows(), {dpi_x, dpi_y}, file);
  }

 private:
  template <class Image>
  Status encode_image(const Image& pixels, std::uint32_t columns, std::uint32_t rows, std::array<double, 2> dpi, Bytes& file) {
    if (Status status = check_size("TIFF", columns, rows); !status) return status;
    TagFrame frame{columns, rows, dpi[0], dpi[1], 1, COMPRESSION_CCITTFAX4};
    frame.rows_per_strip = frame.rows;
    file.resize(file.capacity());
    const std::size_t end = encoder_.encode(pixels, file, kStripAt);
    if (end > kMaxClassicBytes - kDirectoryBytes) return refused(frame, "the file would exceed 4 GiB");
    const Ending::TiffLayout image{columns, rows, dpi[0], dpi[1], end - kStripAt > UINT16_MAX};
    if (!text_.any() && ending_.put(image, end, file)) return {};
    if (file.size() < end + kDirectoryBytes) file.resize(end + kDirectoryBytes);
    Status status = write_file(file, frame, text_, [&](TIFF* tiff) {
      const auto length = static_cast<tmsize_t>(end - kStripAt);
      return TIFFWriteRawStrip(tiff, 0, file.data() + kStripAt, length) == length;
    });
    if (status && !text_.any()) ending_.take(image, file, end);
    return status;
  }

  LayerText text_;
  g4::Encoder encoder_;
  Ending ending_;  // of the layer before
};

class StripEncoder : public RowEncoder {
 public:
  void tag(const LayerTags& tags) override { text_.take(tags); }
  explicit StripEncoder(std::uint16_t compression) : compression_(compression) {}

 private:
  Status encode_rows(RowBits image, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size("TIFF", image.columns, image.rows); !status) return status;
    const TagFrame frame{image.columns, image.rows, dpi_x, dpi_y, 1, compression_};
    if (compression_ == COMPRESSION_NONE) {  // its size is known: nothing has to grow, and no second copy exists meanwhile
      if (frame.stride * frame.rows > kMaxClassicBytes - kStripBytes) {
        return refused(frame, "the file would exceed 4 GiB; use --format tiff-g4");
      }
      const std::size_t strips = ceil_div<std::size_t>(frame.rows, frame.rows_per_strip);
      file.clear();
      file.reserve(kStripAt + frame.stride * frame.rows + kDirectoryBytes + strips * 2 * sizeof(std::uint32_t));
    }
    file.resize(file.capacity());
    return write_rows(file, frame, text_, strip_, [&](std::uint32_t r, std::span<std::byte> to) { image.put(r, to); });
  }

  LayerText text_;
  std::uint16_t compression_;
  Bytes strip_;  // of bits
};

/// Deflate, strip by strip, of dithered images.
class DeflateEncoder : public ImageEncoder {
 public:
  void tag(const LayerTags& tags) override { text_.take(tags); }

  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    return encode_rows(runs, dpi_x, dpi_y, file);
  }
  Status encode(const BitRows& rows, double dpi_x, double dpi_y, Bytes& file) override {
    if (!rows.has_spans()) return encode_rows(rows, dpi_x, dpi_y, file);
    return encode_strips(rows.columns(), rows.rows(), {dpi_x, dpi_y}, kEdgeStripBytes, file,
                         [&](std::uint32_t begin, std::uint32_t end, std::size_t stride) {
                           edges_.start();
                           for (std::uint32_t row = begin; row < end; ++row) rows.spans(row, spans_), edges_.add(spans_, stride);
                           return edges_.finish(packed_.data());
                         });
  }

 private:
  Status encode_rows(RowBits image, double dpi_x, double dpi_y, Bytes& file) {
    deflate_.start();
    return encode_strips(image.columns, image.rows, {dpi_x, dpi_y}, kStripBytes, file,
                         [&](std::uint32_t begin, std::uint32_t end, std::size_t stride) {
                           return deflate_.compress_rows(image, begin, end, stride, packed_.data());
                         });
  }
  /// put_strip(first row, end, bytes of a row)  writes a strip to packed_ and returns its length
  template <class PutStrip>
  Status encode_strips(std::uint32_t columns, std::uint32_t rows, std::array<double, 2> dpi, std::size_t strip_bytes,
                       Bytes& file, const PutStrip& put_strip) {
    if (Status status = check_size("TIFF", columns, rows); !status) return status;
    TagFrame frame{columns, rows, dpi[0], dpi[1], 1, COMPRESSION_ADOBE_DEFLATE};
    frame.rows_per_strip = static_cast<std::uint32_t>(std::clamp<std::size_t>(strip_bytes / frame.stride, 1, rows));
    file.resize(file.capacity());
    return write_file(file, frame, text_, [&](TIFF* tiff) {
      packed_.resize(StripCode::bound(frame.stride * frame.rows_per_strip));
      return put_packed(tiff, frame, [&](std::uint32_t begin, std::uint32_t end) {
        return std::span(packed_).first(put_strip(begin, end, frame.stride));
      });
    });
  }

  LayerText text_;
  DitherDeflate deflate_;
  EdgeDeflate edges_;
  WordSpans spans_;
  Bytes packed_;
};

}  // namespace

std::unique_ptr<ImageEncoder> make_deflate_encoder() { return std::make_unique<DeflateEncoder>(); }
std::unique_ptr<ImageEncoder> make_g4_encoder() { return std::make_unique<G4Encoder>(); }
std::unique_ptr<ImageEncoder> make_packbits_encoder() { return std::make_unique<StripEncoder>(COMPRESSION_PACKBITS); }
std::unique_ptr<ImageEncoder> make_uncompressed_encoder() { return std::make_unique<StripEncoder>(COMPRESSION_NONE); }

// TIFF of 4 or 8 bits a pixel, min-is-white: the darkest value is a full voxel. TIFF 6.0, sections 4 and 9.

namespace {

class GreyEncoder : public LevelEncoder {
 public:
  explicit GreyEncoder(unsigned bits) : bits_(bits), darkest_((1u << bits) - 1) {}
  void tag(const LayerTags& tags) override { text_.take(tags); }

  Status encode(const BitRows& image, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size("TIFF", image.columns(), image.rows()); !status) return status;
    const TagFrame frame{image.columns(), image.rows(), dpi_x, dpi_y, static_cast<std::uint16_t>(bits_), COMPRESSION_PACKBITS};
    file.resize(file.capacity());
    Buffer<std::uint64_t> words(image.words());
    return write_rows(file, frame, text_, strip_, [&](std::uint32_t row, std::span<std::byte> to) {
      image.row(row, words);
      const auto set = [&](std::size_t column) { return column < frame.columns ? words[column / 64] >> column % 64 & 1 : 0; };
      for (std::size_t i = 0; i < to.size(); ++i)
        to[i] = static_cast<std::byte>(bits_ == 8 ? 255 * set(i) : 240 * set(2 * i) + 15 * set(2 * i + 1));
    });
  }

  Status encode(const LevelsView& image, std::uint8_t full, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size("TIFF", image.columns, image.rows()); !status) return status;
    const TagFrame frame{image.columns, image.rows(), dpi_x, dpi_y, static_cast<std::uint16_t>(bits_), COMPRESSION_PACKBITS};
    if (full == 0 || darkest_ % full != 0) {
      return refused(frame, fmt::format("{} levels are no whole steps of {} bits", full + 1, bits_));
    }
    file.resize(file.capacity());
    return write_file(file, frame, text_, [&](TIFF* tiff) {
      return put_packed(tiff, frame, [&](std::uint32_t begin, std::uint32_t end) {
        packed_.start();
        for (std::uint32_t row = begin; row < end; ++row) {
          packed_.start_row(frame.stride);
          bits_ == 8 ? put_bytes(image, row, darkest_ / full, packed_) : put_nibbles(image, row, darkest_ / full, packed_);
        }
        return std::span(packed_.data(), packed_.size());
      });
    });
  }

 private:
  LayerText text_;
  unsigned bits_, darkest_;
  Bytes strip_;
  PackBits packed_;
};

}  // namespace

std::unique_ptr<LevelEncoder> make_4_bit_encoder() { return std::make_unique<GreyEncoder>(4); }
std::unique_ptr<LevelEncoder> make_8_bit_encoder() { return std::make_unique<GreyEncoder>(8); }

}  // namespace lamina::formats::tiff

namespace lamina::formats {
namespace {

constexpr std::uint64_t kLargestStrip = 64 << 20;  // bytes; nobody writes a larger one

/// Rows of `stride` bytes that `bytes` of this compression can hold at most; a header that promises more lies.
std::uint64_t max_rows(std::uint16_t compression, std::uint64_t bytes, std::uint64_t stride) {
  switch (compression) {
    case COMPRESSION_NONE: return bytes / stride;
    case COMPRESSION_PACKBITS: return bytes * 64 / stride;  // two bytes make 128
    case COMPRESSION_CCITTFAX4:
    case COMPRESSION_CCITTFAX3:
    case COMPRESSION_CCITTRLE: return bytes * 8;  // a row takes a bit
    default: return bytes * 2048 / stride + 1;    // deflate 1032, LZW about 1400
  }
}

/// Why the strips cannot hold the rows, or nothing if they can.
std::string check_strips(TIFF* tiff, std::uint64_t file_bytes, std::uint16_t compression, std::uint32_t rows,
                         std::uint64_t stride) {
  std::uint32_t rows_per_strip = rows;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &rows_per_strip);
  rows_per_strip = std::min(rows_per_strip, rows);
  if (rows_per_strip == 0) return "strips of no rows";
  const std::uint32_t strips = TIFFNumberOfStrips(tiff);
  if (strips != (rows + rows_per_strip - 1) / rows_per_strip) return "its number of strips does not fit its rows";
  for (std::uint32_t strip = 0; strip < strips; ++strip) {
    const std::uint64_t offset = TIFFGetStrileOffset(tiff, strip), bytes = TIFFGetStrileByteCount(tiff, strip);
    if (offset < 8 || bytes == 0 || offset > file_bytes || bytes > file_bytes - offset) {
      return fmt::format("strip {} is not within the file", strip);
    }
    const std::uint32_t strip_rows = std::min(rows_per_strip, rows - strip * rows_per_strip);
    if (max_rows(compression, bytes, stride) < strip_rows) return fmt::format("strip {} is too short", strip);
  }
  return {};
}

/// The image of a file in Group 4, without bits. false: libtiff has to say what is wrong with it, or to read it.
bool read_g4(TIFF* tiff, int file, std::uint32_t columns, std::uint32_t rows, bool white_is_set, RunsBuilder& builder) {
  std::uint32_t rows_per_strip = rows;
  std::uint16_t fill_order = FILLORDER_MSB2LSB;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &rows_per_strip);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_FILLORDER, &fill_order);
  rows_per_strip = std::min(rows_per_strip, rows);
  G4Decoder decoder;
  Buffer<std::byte> coded;
  for (std::uint32_t row = 0, strip = 0; row < rows; row += rows_per_strip, ++strip) {
    const std::uint64_t size = TIFFGetStrileByteCount(tiff, strip);
    if (size > kLargestStrip) return false;
    coded.resize(size);
    const auto position = static_cast<off_t>(TIFFGetStrileOffset(tiff, strip));
    if (::pread(file, coded.data(), coded.size(), position) != static_cast<ssize_t>(coded.size())) return false;
    const G4Strip of_rows{columns, std::min(rows_per_strip, rows - row), fill_order == FILLORDER_LSB2MSB, white_is_set};
    if (!decoder.append(coded, of_rows, builder)) return false;
  }
  return true;
}

/// The resolutions of a directory of a classic TIFF as fractions, which libtiff rounds to floats. Unchanged if there are none.
void read_fractions(int file, std::uint64_t directory, std::array<double, 2>& resolution) {
  Bytes bytes(4);
  const auto read = [&](std::uint64_t at) {
    return ::pread(file, bytes.data(), bytes.size(), static_cast<off_t>(at)) == static_cast<ssize_t>(bytes.size());
  };
  if (!read(0)) return;
  const bool swapped = bytes[0] == std::byte{'M'};
  const auto whole = [&](std::size_t at, auto number) {
    number = tiff::number_at<decltype(number)>(bytes, at);
    if (swapped) std::ranges::reverse(std::as_writable_bytes(std::span(&number, 1)));
    return number;
  };
  constexpr std::uint16_t kClassic = 42, kShort = 0;
  constexpr std::uint32_t kLong = 0;
  if (whole(2, kShort) != kClassic) return;
  bytes.resize(2);
  if (!read(directory)) return;
  const std::size_t entries = whole(0, kShort);
  bytes.resize(entries * tiff::kEntryBytes);
  if (!read(directory + 2)) return;
  std::array<std::uint32_t, 2> fraction_at{};
  for (std::size_t at = 0; at < entries * tiff::kEntryBytes; at += tiff::kEntryBytes) {
    const std::uint16_t tag = whole(at, kShort);
    if ((tag == TIFFTAG_XRESOLUTION || tag == TIFFTAG_YRESOLUTION) && whole(at + 2, kShort) == TIFF_RATIONAL)
      fraction_at[tag == TIFFTAG_XRESOLUTION ? 0 : 1] = whole(at + 8, kLong);
  }
  bytes.resize(8);
  for (std::size_t a = 0; a < 2; ++a) {
    if (fraction_at[a] == 0 || !read(fraction_at[a]) || whole(4, kLong) == 0) continue;
    resolution[a] = static_cast<double>(whole(0, kLong)) / whole(4, kLong);
  }
}

/// In dpi; 0 where the file does not say.
void read_resolution(TIFF* tiff, int file, Image& image) {
  std::uint16_t unit = RESUNIT_INCH;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_RESOLUTIONUNIT, &unit);
  float x = 0, y = 0;
  if (TIFFGetField(tiff, TIFFTAG_XRESOLUTION, &x) == 0 || TIFFGetField(tiff, TIFFTAG_YRESOLUTION, &y) == 0) return;
  if (unit == RESUNIT_NONE) return;
  std::array<double, 2> resolution{x, y};
  read_fractions(file, TIFFCurrentDirOffset(tiff), resolution);
  const double to_inch = unit == RESUNIT_CENTIMETER ? 2.54 : 1;
  image.dpi_x = resolution[0] * to_inch;
  image.dpi_y = resolution[1] * to_inch;
}

/// What no writer of layers says is longer.
constexpr std::size_t kLongestDescription = 1000;

std::string description_of(TIFF* tiff) {
  const char* text = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_IMAGEDESCRIPTION, &text) == 0 || text == nullptr) return {};
  return std::string(text).substr(0, kLongestDescription);
}

/// The contents of an image's directory.
struct TiffHead {
  std::uint32_t columns = 0, rows = 0;
  std::uint16_t bits = 1, samples = 1, photometric = 0, compression = COMPRESSION_NONE;
  bool grey() const { return bits > 1; }
  bool bright_is_low() const { return photometric == PHOTOMETRIC_MINISWHITE; }
  std::size_t stride() const { return (std::size_t{columns} * bits + 7) / 8; }
};

/// returns  why it cannot be read, or nothing
std::string read_tiff_head(TIFF* tiff, std::uint64_t file_bytes, int threshold, const LevelSink* sink, TiffHead& head) {
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &head.columns);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &head.rows);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &head.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &head.samples);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_COMPRESSION, &head.compression);
  const std::uint16_t bits = head.bits;
  const bool exact = sink != nullptr && !sink->nearest;
  const bool grey = exact ? bits == 4 || bits == 8 : threshold > 0 && (bits == 2 || bits == 4 || bits == 8 || bits == 16);
  const bool known = TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &head.photometric) != 0;
  if (!known || head.photometric > PHOTOMETRIC_MINISBLACK || (!grey && (exact || bits != 1)) || head.samples != 1) {
    if (exact) return "neither 4 nor 8 bits of grey";
    return threshold > 0 ? "neither 1-bit nor grey of 2, 4, 8 or 16 bits" : "not a 1-bit image";
  }
  std::uint16_t kind = SAMPLEFORMAT_UINT;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &kind);
  if (grey && kind != SAMPLEFORMAT_UINT) return "its values are not whole numbers from 0 on";
  std::uint16_t orientation = ORIENTATION_TOPLEFT;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ORIENTATION, &orientation);
  if (orientation != ORIENTATION_TOPLEFT) {
    return fmt::format("its Orientation tag is {}; write rows from the top and columns from the left, tag 1", orientation);
  }
  if (TIFFIsTiled(tiff) != 0) return "tiles are not supported";
  if (head.columns == 0 || head.rows == 0 || head.columns > kMaxPixelsASide || head.rows > kMaxPixelsASide) {
    return fmt::format("{} x {} pixels", head.columns, head.rows);
  }
  if (std::string wrong = check_strips(tiff, file_bytes, head.compression, head.rows, head.stride()); !wrong.empty())
    return wrong;
  return TIFFScanlineSize(tiff) == static_cast<tmsize_t>(head.stride()) ? "" : "rows of an unexpected length";
}

/// Whether the current directory is a thumbnail or a mask. Damage of such a one does not matter.
bool is_no_layer(TIFF* tiff, std::string& message) {
  std::uint32_t kind = 0;
  TIFFGetField(tiff, TIFFTAG_SUBFILETYPE, &kind);
  if ((kind & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0) return false;
  message.clear();
  return true;
}

/// Finds the directory of the only image that is no thumbnail; the first one if all are.
/// page  its position, to be selected; 0: it is the current one. returns  false if there are several
bool select_only_image(TIFF* tiff, std::string& message, std::uint64_t& page) {
  if (TIFFLastDirectory(tiff) != 0) return true;
  const std::uint64_t first = TIFFCurrentDirOffset(tiff);
  std::string kept = message;
  do {
    if (is_no_layer(tiff, message)) continue;
    if (page != 0) return false;
    page = TIFFCurrentDirOffset(tiff);
  } while (message.empty() && TIFFReadDirectory(tiff) != 0);
  if (page == 0) page = first, message = std::move(kept);
  return true;
}

/// One row as libtiff decodes it. returns  why not, or nothing
std::string_view add_tiff_row(std::span<std::byte> row, const TiffHead& head, int threshold, LevelSink* sink,
                              RunsBuilder& builder) {
  // Values of two bytes are in the order of this program's hosts, little-endian. Those of min-is-white: bright is small.
  const bool low = head.bright_is_low();
  unsigned bits = head.bits;
  if (bits == 2) {
    static const Colours kColours = Colours::of_grey(3);
    widen_row(row, head.columns, bits, kColours);
    bits = 8;
  }
  if (head.grey() && sink != nullptr) return sink->add_row(row, head.columns, bits, low) ? "" : "a value is no level";
  const int below = low ? 256 - threshold : threshold;
  if (bits == 4) bits_of_nibbles(row, head.columns, below);
  if (bits >= 8) bits_of_grey(row, head.columns, bits / 8u, bits == 16, below);
  return builder.add_row(row.first(row_bytes(head.columns)), head.grey() ? low : !low) ? "" : "too many runs";
}

}  // namespace

Result<Image> read_tiff(int file, std::uint64_t bytes, const std::string& path, int threshold, std::uint64_t page,
                        LevelSink* sink, Keep keep) {
  tiff::Input input(file, path, page);
  std::string& message = input.message;
  TIFF* const handle = input.handle();
  const auto failure = [&](std::string_view why) {
    return Error{Fault::kVerification, fmt::format("{}: not a whole {}TIFF: {}; plan the layer again", path,
                                                   threshold > 0 || sink != nullptr ? "" : "1-bit ", why)};
  };
  if (handle == nullptr) return failure(message.empty() ? "no directory" : message);
  if (page == 0 && !select_only_image(handle, message, page) && threshold > 0)
    return failure("several images in one file; write one a layer");
  if (page != 0 && page != TIFFCurrentDirOffset(handle) && TIFFSetSubDirectory(handle, page) == 0)
    return failure(message.empty() ? "no such page" : message);
  if (!message.empty()) return failure(message);
  TiffHead head;
  const std::string wrong = read_tiff_head(handle, bytes, threshold, sink, head);
  if (!wrong.empty()) return failure(wrong);

  const bool to_sink = head.grey() && sink != nullptr;
  if (to_sink) sink->levels.start(head.columns);
  Image image;
  read_resolution(handle, file, image);
  image.description = description_of(handle);
  RunsBuilder builder(head.columns, head.rows, keep);
  const auto finish = [&] {
    Image whole = image_of(builder, head.columns, image.dpi_x, image.dpi_y);
    whole.description = std::move(image.description);
    return whole;
  };
  if (head.compression == COMPRESSION_CCITTFAX4 && !head.grey()) {
    if (read_g4(handle, file, head.columns, head.rows, !head.bright_is_low(), builder)) return finish();
    builder = RunsBuilder(head.columns, head.rows, keep);
  }
  Buffer<std::byte> row(head.bits == 2 ? head.columns : head.stride());
  for (std::uint32_t r = 0; r < head.rows; ++r) {
    if (TIFFReadScanline(handle, row.data(), r, 0) < 0 || !message.empty()) {
      return failure(fmt::format("row {}: {}", r, message.empty() ? "cannot be decoded" : message));
    }
    if (const std::string_view why = add_tiff_row(row, head, threshold, sink, builder); !why.empty())
      return failure(fmt::format("row {}: {}", r, why));
  }
  return finish();
}

Result<std::vector<std::uint64_t>> tiff_pages(int file, const std::string& path) {
  constexpr std::size_t kMaxPages = 1 << 20;
  tiff::Input input(file, path, 0);
  std::string& message = input.message;
  TIFF* const handle = input.handle();
  const auto failure = [&](const std::string& why) {
    return Error{Fault::kInput, fmt::format("{}: {}; take a whole file", path, why)};
  };
  if (handle == nullptr) return failure("not a TIFF: " + message);
  std::vector<std::uint64_t> pages;
  const bool alone = TIFFLastDirectory(handle) != 0;
  do {
    if (!is_no_layer(handle, message)) pages.push_back(TIFFCurrentDirOffset(handle));
  } while (pages.size() <= kMaxPages && TIFFReadDirectory(handle) != 0);
  if (!message.empty() || pages.size() > kMaxPages) {
    return failure(fmt::format("page {}: {}", pages.size(), message.empty() ? "too many of them" : message));
  }
  if (pages.empty() || alone) pages.assign(1, 0);
  return pages;
}

}  // namespace lamina::formats
