#include "stages/formats/tiff/tiff.h"

#include <fmt/format.h>

#include <unistd.h>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "stages/data/units.h"
#include "stages/formats/g4/decode.h"
#include "stages/formats/g4/encode.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/image_formats.h"
#include "stages/formats/tiff/tags.h"
#include "stages/geometry/bits.h"
#include "stages/support/late/tiff.h"

namespace lamina::formats::tiff {
namespace {

// libtiff's header of a classic TIFF. The first strip follows it.
constexpr std::size_t kHeaderBytes = 8;

class G4Encoder : public ImageEncoder {
 public:
  void tag(const LayerTags& tags) override { text_.take(tags); }
  void use(Isa isa) override { encoder_ = g4::Encoder(isa); }

  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size(runs.columns, runs.rows()); !status) return status;
    file.resize(file.capacity());
    const std::size_t end = encoder_.encode(runs, file, kHeaderBytes);
    if (end > kMaxClassicBytes - kDirectoryBytes) return cannot_hold(runs.columns, runs.rows(), "the file would exceed 4 GiB");
    const Ending::TiffLayout image{runs.columns, runs.rows(), dpi_x, dpi_y, end - kHeaderBytes > UINT16_MAX};
    if (!text_.any() && ending_.put(image, end, file)) return {};
    if (file.size() < end + kDirectoryBytes) file.resize(end + kDirectoryBytes);

    MemoryFile memory{file};
    std::string message;
    TiffHandle tiff = open_for_writing(memory, message);
    if (tiff == nullptr) return cannot_hold(runs.columns, runs.rows(), message);
    set_tags(tiff.get(), {runs.columns, runs.rows(), dpi_x, dpi_y}, 1, COMPRESSION_CCITTFAX4, runs.rows());
    text_.put(tiff.get());
    const auto length = static_cast<tmsize_t>(end - kHeaderBytes);
    const bool written = TIFFWriteRawStrip(tiff.get(), 0, file.data() + kHeaderBytes, length) == length;
    Status status = finish(std::move(tiff), written, memory, {runs.columns, runs.rows(), dpi_x, dpi_y}, message);
    if (status && !text_.any()) ending_.take(image, file, end);
    return status;
  }

 private:
  LayerText text_;
  g4::Encoder encoder_;
  Ending ending_;  // of the layer before
};

class StripEncoder : public ImageEncoder {
 public:
  void tag(const LayerTags& tags) override { text_.take(tags); }
  explicit StripEncoder(std::uint16_t compression) : compression_(compression) {}

  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size(runs.columns, runs.rows()); !status) return status;
    const std::size_t stride = row_bytes(runs.columns);
    if (compression_ == COMPRESSION_NONE && stride * runs.rows() > kMaxClassicBytes - kStripBytes) {
      return cannot_hold(runs.columns, runs.rows(), "the file would exceed 4 GiB; use --format tiff-g4");
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
    if (tiff == nullptr) return cannot_hold(runs.columns, runs.rows(), message);
    set_tags(tiff.get(), {runs.columns, runs.rows(), dpi_x, dpi_y}, 1, compression_, rows_per_strip);
    text_.put(tiff.get());

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
    return finish(std::move(tiff), written, memory, {runs.columns, runs.rows(), dpi_x, dpi_y}, message);
  }

 private:
  LayerText text_;
  std::uint16_t compression_;
  Bytes bits_;  // of one strip
};

}  // namespace

std::unique_ptr<ImageEncoder> make_g4_encoder() { return std::make_unique<G4Encoder>(); }
std::unique_ptr<ImageEncoder> make_packbits_encoder() { return std::make_unique<StripEncoder>(COMPRESSION_PACKBITS); }
std::unique_ptr<ImageEncoder> make_uncompressed_encoder() { return std::make_unique<StripEncoder>(COMPRESSION_NONE); }

// TIFF of 4 or 8 bits a pixel, min-is-white: the darkest value is a full voxel. TIFF 6.0, sections 4 and 9.

namespace {

class GreyEncoder : public LevelEncoder {
 public:
  explicit GreyEncoder(unsigned bits) : bits_(bits), darkest_((1u << bits) - 1) {}
  void tag(const LayerTags& tags) override { text_.take(tags); }

  Status encode(const LevelsView& image, std::uint8_t full, double dpi_x, double dpi_y, Bytes& file) override {
    const TagFrame frame{image.columns, image.rows(), dpi_x, dpi_y};
    if (Status status = check_size(frame.columns, frame.rows); !status) return status;
    if (full == 0 || darkest_ % full != 0) {
      return cannot_hold(frame.columns, frame.rows, fmt::format("{} levels are no whole steps of {} bits", full + 1, bits_));
    }
    const std::size_t stride = (std::size_t{image.columns} * bits_ + 7) / 8;
    const auto rows_per_strip = static_cast<std::uint32_t>(std::clamp<std::size_t>(kStripBytes / stride, 1, frame.rows));
    file.resize(file.capacity());
    MemoryFile memory{file};
    std::string message;
    TiffHandle tiff = open_for_writing(memory, message);
    if (tiff == nullptr) return cannot_hold(frame.columns, frame.rows, message);
    set_tags(tiff.get(), frame, static_cast<std::uint16_t>(bits_), COMPRESSION_PACKBITS, rows_per_strip);
    text_.put(tiff.get());
    bool written = true;
    strip_.resize(stride * rows_per_strip);
    for (std::uint32_t first = 0, strip = 0; first < frame.rows && written; first += rows_per_strip, ++strip) {
      const std::uint32_t rows = std::min(rows_per_strip, frame.rows - first);
      const std::size_t length = stride * rows;
      std::memset(strip_.data(), 0, length);
      for (std::uint32_t r = 0; r < rows; ++r) put_row(image, first + r, darkest_ / full, strip_.data() + stride * r);
      written = TIFFWriteEncodedStrip(tiff.get(), strip, strip_.data(), static_cast<tmsize_t>(length)) ==
                static_cast<tmsize_t>(length);
    }
    return finish(std::move(tiff), written, memory, frame, message);
  }

 private:
  /// The runs of a row over zeros. Of 4 bits the left pixel is in the high ones.
  void put_row(const LevelsView& image, std::uint32_t row, unsigned step, std::byte* to) const {
    for (std::uint32_t i = image.row_offset[row]; i < image.row_offset[row + 1]; ++i) {
      const unsigned value = image.level[i] * step;
      std::uint32_t begin = image.change[2 * i], end = image.change[2 * i + 1];
      if (bits_ == 8) {
        std::memset(to + begin, static_cast<int>(value), end - begin);
        continue;
      }
      if (begin % 2 != 0) to[begin++ / 2] |= static_cast<std::byte>(value);
      if (end > begin && end % 2 != 0) to[--end / 2] |= static_cast<std::byte>(value << 4);
      if (end > begin) std::memset(to + begin / 2, static_cast<int>(value * 17), (end - begin) / 2);
    }
  }

  LayerText text_;
  unsigned bits_, darkest_;
  Bytes strip_;
};

}  // namespace

std::unique_ptr<LevelEncoder> make_4_bit_encoder() { return std::make_unique<GreyEncoder>(4); }
std::unique_ptr<LevelEncoder> make_8_bit_encoder() { return std::make_unique<GreyEncoder>(8); }

}  // namespace lamina::formats::tiff

namespace lamina::formats {
namespace {

constexpr std::uint32_t kLargestAllocation = 64 << 20;  // bytes; no strip that anybody writes is larger

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

/// Not mapped: a file that becomes shorter while it is read is an error then, and no signal.
constexpr const char* kMode = "rCm";

/// The image of a file in Group 4, without bits. false: libtiff has to say what is wrong with it, or to read it.
bool read_g4(TIFF* tiff, int file, std::uint32_t columns, std::uint32_t rows, bool white_is_set, Runs& runs) {
  std::uint32_t rows_per_strip = rows;
  std::uint16_t fill_order = FILLORDER_MSB2LSB;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &rows_per_strip);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_FILLORDER, &fill_order);
  rows_per_strip = std::min(rows_per_strip, rows);
  runs.columns = columns;
  runs.row_offset.assign(1, 0);
  G4Decoder decoder;
  Buffer<std::byte> coded;
  for (std::uint32_t row = 0, strip = 0; row < rows; row += rows_per_strip, ++strip) {
    const std::uint64_t size = TIFFGetStrileByteCount(tiff, strip);
    if (size > kLargestAllocation) return false;
    coded.resize(size);
    const auto position = static_cast<off_t>(TIFFGetStrileOffset(tiff, strip));
    if (::pread(file, coded.data(), coded.size(), position) != static_cast<ssize_t>(coded.size())) return false;
    const G4Strip of_rows{columns, std::min(rows_per_strip, rows - row), fill_order == FILLORDER_LSB2MSB, white_is_set};
    if (!decoder.append(coded, of_rows, runs)) return false;
  }
  return true;
}

/// In dpi; 0 where the file does not say.
void read_resolution(TIFF* tiff, Image& image) {
  std::uint16_t unit = RESUNIT_INCH;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_RESOLUTIONUNIT, &unit);
  float x = 0, y = 0;
  if (TIFFGetField(tiff, TIFFTAG_XRESOLUTION, &x) == 0 || TIFFGetField(tiff, TIFFTAG_YRESOLUTION, &y) == 0) return;
  if (unit == RESUNIT_NONE) return;
  const double to_inch = unit == RESUNIT_CENTIMETER ? 2.54 : 1;
  image.dpi_x = double{x} * to_inch;
  image.dpi_y = double{y} * to_inch;
}

}  // namespace

namespace {

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
  const bool grey = exact ? bits == 4 || bits == 8 : threshold > 0 && (bits == 4 || bits == 8 || bits == 16);
  const bool known = TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &head.photometric) != 0;
  if (!known || head.photometric > PHOTOMETRIC_MINISBLACK || (!grey && (exact || bits != 1)) || head.samples != 1) {
    if (exact) return "neither 4 nor 8 bits of grey";
    return threshold > 0 ? "neither 1-bit nor grey of 4, 8 or 16 bits" : "not a 1-bit image";
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

/// One row as libtiff decodes it. returns  why not, or nothing
std::string_view add_tiff_row(std::span<std::byte> row, const TiffHead& head, int threshold, LevelSink* sink,
                              RunsBuilder& builder) {
  // Values of two bytes are in the order of this program's hosts, little-endian. Those of min-is-white: bright is small.
  const bool low = head.bright_is_low();
  if (head.grey() && sink != nullptr) return sink->add_row(row, head.columns, head.bits, low) ? "" : "a value is no level";
  const int below = low ? 256 - threshold : threshold;
  if (head.bits == 4) bits_of_nibbles(row, head.columns, below);
  if (head.bits >= 8) bits_of_grey(row, head.columns, head.bits / 8u, head.bits == 16, below);
  return builder.add_row(row.first(row_bytes(head.columns)), head.grey() ? low : !low) ? "" : "too many runs";
}

}  // namespace

Result<Image> read_tiff(int file, std::uint64_t bytes, const std::string& path, int threshold, std::uint64_t page, LevelSink* sink) {
  std::string message;  // of libtiff, outlives the handle
  const auto failure = [&](std::string_view why) {
    return Error{Fault::kVerification, fmt::format("{}: not a whole {}TIFF: {}; plan the layer again", path,
                                                   threshold > 0 || sink != nullptr ? "" : "1-bit ", why)};
  };
  const auto options = strict_tiff_options(message);
  const int own_file = ::dup(file);
  if (options == nullptr || own_file < 0) {
    if (own_file >= 0) ::close(own_file);
    return failure(message.empty() ? "out of memory or files" : message);
  }
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kLargestAllocation);
  const TiffHandle handle(TIFFFdOpenExt(own_file, path.c_str(), kMode, options.get()));
  if (handle == nullptr) {
    ::close(own_file);
    return failure(message.empty() ? "no directory" : message);
  }
  if (page != 0 && TIFFSetSubDirectory(handle.get(), page) == 0) return failure(message.empty() ? "no such page" : message);
  if (!message.empty()) return failure(message);
  TiffHead head;
  const std::string wrong = read_tiff_head(handle.get(), bytes, threshold, sink, head);
  if (!wrong.empty()) return failure(wrong);
  if (threshold > 0 && page == 0 && TIFFLastDirectory(handle.get()) == 0)
    return failure("several images in one file; write one a layer");

  const bool to_sink = head.grey() && sink != nullptr;
  if (to_sink) sink->levels.start(head.columns);
  Image image;
  read_resolution(handle.get(), image);
  image.description = description_of(handle.get());
  if (head.compression == COMPRESSION_CCITTFAX4 && !head.grey() &&
      read_g4(handle.get(), file, head.columns, head.rows, !head.bright_is_low(), image.runs)) {
    return image;
  }
  RunsBuilder builder(head.columns);
  Buffer<std::byte> row(head.stride());
  for (std::uint32_t r = 0; r < head.rows; ++r) {
    if (TIFFReadScanline(handle.get(), row.data(), r, 0) < 0 || !message.empty()) {
      return failure(fmt::format("row {}: {}", r, message.empty() ? "cannot be decoded" : message));
    }
    if (const std::string_view why = add_tiff_row(row, head, threshold, sink, builder); !why.empty())
      return failure(fmt::format("row {}: {}", r, why));
  }
  if (!to_sink) image.runs = builder.finish();
  return image;
}

Result<std::vector<std::uint64_t>> tiff_pages(int file, const std::string& path) {
  constexpr std::size_t kMaxPages = 1 << 20;
  std::string message;
  const auto options = strict_tiff_options(message);
  const int own_file = ::dup(file);
  if (options != nullptr) TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kLargestAllocation);
  const TiffHandle handle(options != nullptr && own_file >= 0 ? TIFFFdOpenExt(own_file, path.c_str(), kMode, options.get())
                                                              : nullptr);
  if (handle == nullptr) {
    if (own_file >= 0) ::close(own_file);
    return Error{Fault::kInput, fmt::format("{}: not a TIFF: {}; take a whole file", path, message)};
  }
  std::vector<std::uint64_t> pages;
  do {
    std::uint32_t kind = 0;
    TIFFGetField(handle.get(), TIFFTAG_SUBFILETYPE, &kind);
    if ((kind & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0) pages.push_back(TIFFCurrentDirOffset(handle.get()));
  } while (pages.size() <= kMaxPages && TIFFReadDirectory(handle.get()) != 0);
  if (!message.empty() || pages.size() > kMaxPages) {
    return Error{Fault::kInput, fmt::format("{}: page {}: {}; take a whole file", path, pages.size(),
                                            message.empty() ? "too many of them" : message)};
  }
  return pages;
}

}  // namespace lamina::formats
