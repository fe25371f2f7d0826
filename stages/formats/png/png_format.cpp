#include "stages/formats/png/png_format.h"

#include <fmt/format.h>
#include <png.h>

#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <csetjmp>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <optional>
#include <string_view>

#include "stages/formats/images/image_formats.h"
#include "stages/formats/png/image_data.h"
#include "stages/geometry/bits.h"

namespace lamina::formats::png {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t kHeadBytes = 128;  // of what stands before the image data at most
constexpr std::string_view kSignature = "\x89PNG\r\n\x1A\n";

std::byte* put_text(std::byte* at, std::string_view bytes) {
  std::memcpy(at, bytes.data(), bytes.size());
  return at + bytes.size();
}

/// Pixels a metre, as pHYs has them, rounded to the nearest.
std::uint32_t per_metre(double dpi) { return static_cast<std::uint32_t>((dpi * 10'000 + 127) / 254); }

/// Signature, IHDR, PLTE if any, pHYs.
/// kind     the bytes of IHDR after the size
/// returns  where the image data begin
std::size_t put_first_chunks(Bytes& file, std::uint32_t columns, std::uint32_t rows, std::string_view kind,
                             std::string_view palette, double dpi_x, double dpi_y) {
  file.resize(std::max(file.capacity(), kHeadBytes));
  std::byte* chunk = put_text(file.data(), kSignature);
  std::byte* at = put_number(put_number(chunk + kChunkHead, columns), rows);
  chunk = close_chunk(chunk, put_text(at, kind), "IHDR");
  if (!palette.empty()) chunk = close_chunk(chunk, put_text(chunk + kChunkHead, palette), "PLTE");
  at = put_number(put_number(chunk + kChunkHead, per_metre(dpi_x)), per_metre(dpi_y));
  return static_cast<std::size_t>(close_chunk(chunk, put_text(at, "\x01"sv), "pHYs") - file.data());
}

void put_last_chunk(Bytes& file, std::size_t end) {
  file.resize(end + kChunkHead + kChunkTail);
  close_chunk(file.data() + end, file.data() + end + kChunkHead, "IEND");
}

class PngEncoder : public ImageEncoder {
 public:
  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    return encode_rows(runs, runs.change.size(), dpi_x, dpi_y, file);
  }
  Status encode(const BitRows& rows, double dpi_x, double dpi_y, Bytes& file) override {
    return encode_rows(rows, counts_of(rows).changes, dpi_x, dpi_y, file);
  }

 private:
  static Status encode_rows(RowRuns rows, std::uint64_t changes, double dpi_x, double dpi_y, Bytes& file) {
    if (Status status = check_size("PNG", rows.columns(), rows.rows()); !status) return status;
    constexpr std::string_view kKind = "\x01\x03\0\0\0"sv;  // 1 bit, palette, deflate, filters, not interlaced
    const std::size_t data = put_first_chunks(file, rows.columns(), rows.rows(), kKind, "\xFF\xFF\xFF\0\0\0"sv, dpi_x, dpi_y);
    put_last_chunk(file, put_image_data(rows, changes, file, data));
    return {};
  }
};

}  // namespace

std::unique_ptr<ImageEncoder> make_encoder() { return std::make_unique<PngEncoder>(); }

// PNG of 8-bit grey, in which 0, black, is a full voxel (PNG specification, second edition, 11.2.2).
//
// Rows have no filter and one block of deflate's fixed code: equal bytes are a literal and matches of distance 1 (RFC 1951,
// 3.2.5, 3.2.6), so that the bytes depend on no library.

namespace {

constexpr std::array<std::uint8_t, 288> fixed_lengths() {
  std::array<std::uint8_t, 288> lengths{};
  for (std::size_t s = 0; s < lengths.size(); ++s) lengths[s] = s < 144 ? 8 : s < 256 ? 9 : s < 280 ? 7 : 8;
  return lengths;
}
constexpr auto kFixed = words_of(fixed_lengths());

/// Matches of distance 1, whose own word is five zeros, by length.
constexpr auto kMatch = [] {
  std::array<BitString, kLongestMatch + 1> words{};
  for (std::uint32_t length = kShortestMatch; length <= kLongestMatch; ++length) {
    const LengthClass found = length_class(length);
    words[length] = join(join(kFixed[found.symbol], BitString(found.extra, found.extra_bits)), BitString(0, 5));
  }
  return words;
}();

/// Adler's check (RFC 1950, section 9) of runs of equal bytes.
class Check {
 public:
  void add(std::uint32_t byte, std::uint64_t count) {
    // b grows by a + byte, a + 2 byte, ...
    const std::uint64_t n = count % kPrime,
                        sum = count % 2 == 0 ? count / 2 % kPrime * ((count + 1) % kPrime) : (count + 1) / 2 % kPrime * n;
    b_ = (b_ + n * a_ + sum % kPrime * byte) % kPrime;
    a_ = (a_ + n * byte) % kPrime;
  }
  std::uint32_t value() const { return static_cast<std::uint32_t>(b_ << 16 | a_); }

 private:
  static constexpr std::uint64_t kPrime = 65'521;
  std::uint64_t a_ = 1, b_ = 0;
};

class GreyEncoder : public LevelEncoder {
 public:
  Status encode(const LevelsView& image, std::uint8_t full, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size("PNG", image.columns, image.rows()); !status) return status;
    if (full == 0 || 255 % full != 0) {
      return cannot_hold("PNG", image.columns, image.rows(), fmt::format("{} levels are no whole steps of 8 bits", full + 1));
    }
    encode_rows(image.columns, image.rows(), dpi_x, dpi_y, file, [&](std::uint32_t r, const auto& put_run) {
      for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i)
        put_run(image.change[2 * i], image.change[2 * i + 1], image.level[i] * (255u / full));
    });
    return {};
  }
  Status encode(const BitRows& image, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size("PNG", image.columns(), image.rows()); !status) return status;
    RowRuns rows(image);
    encode_rows(image.columns(), image.rows(), dpi_x, dpi_y, file, [&](std::uint32_t r, const auto& put_run) {
      const std::span<const std::uint32_t> row = rows.row(r);
      for (std::size_t i = 0; i + 1 < row.size(); i += 2) put_run(row[i], row[i + 1], 255u);
    });
    return {};
  }

 private:
  static constexpr std::size_t kWords = 16;  // bytes, of the words between two tests of the capacity at most

  /// each_run(row, put_run)  calls put_run(begin, end, darkness) for the runs of a row
  template <class EachRun>
  void encode_rows(std::uint32_t columns, std::uint32_t rows, double dpi_x, double dpi_y, Bytes& file, const EachRun& each_run) {
    constexpr std::string_view kKind = "\x08\0\0\0\0"sv;  // 8 bits, grey, deflate, filters, not interlaced
    Chunks chunks(file, put_first_chunks(file, columns, rows, kKind, {}, dpi_x, dpi_y));
    BitWriter out(chunks.content());
    out.put(kZlibHeader, 16);
    out.put(0b011, 3);  // the last block, of the fixed code
    check_ = Check();
    for (std::uint32_t r = 0; r < rows; ++r) {
      put(0, 1, out, chunks);  // no filter
      std::uint32_t at = 0;
      each_run(r, [&](std::uint32_t begin, std::uint32_t end, unsigned darkness) {
        put(255, begin - at, out, chunks);
        put(255u - darkness, end - begin, out, chunks);
        at = end;
      });
      put(255, columns - at, out, chunks);
    }
    chunks.ensure_capacity(out, kWords);
    out.put(kFixed[kEndOfBlock]);
    put_last_chunk(file, chunks.close(put_number(out.finish(), check_.value())));
  }

  void put(std::uint32_t byte, std::uint64_t count, BitWriter& out, Chunks& chunks) {
    if (count == 0) return;
    check_.add(byte, count);
    chunks.ensure_capacity(out, kWords);
    out.put(kFixed[byte]);
    for (--count; count > 0;) {
      chunks.ensure_capacity(out, kWords);
      const auto length = static_cast<std::uint32_t>(std::min<std::uint64_t>(count, kLongestMatch));
      if (length < kShortestMatch) {
        for (std::uint32_t i = 0; i < length; ++i) out.put(kFixed[byte]);
      } else {
        out.put(kMatch[length]);
      }
      count -= length;
    }
  }

  Check check_;
};

}  // namespace

std::unique_ptr<LevelEncoder> make_8_bit_encoder() { return std::make_unique<GreyEncoder>(); }

namespace {

void add_chunk(Buffer<std::byte>& file, std::string_view name, std::span<const std::byte> content) {
  const std::size_t begin = file.size();
  file.resize(begin + kChunkHead);
  file.insert(file.end(), content.begin(), content.end());
  file.resize(file.size() + kChunkTail);
  close_chunk(file.data() + begin, file.data() + file.size() - kChunkTail, name);
}

}  // namespace

Buffer<std::byte> coloured(std::uint32_t columns, std::span<const std::string> colours, std::span<const std::uint8_t> pixels) {
  const auto rows = static_cast<std::uint32_t>(pixels.size() / columns);
  const auto signature = std::as_bytes(std::span(kSignature));
  Buffer<std::byte> file(signature.begin(), signature.end()), part(13, std::byte{});
  put_number(put_number(part.data(), columns), rows);
  part[8] = std::byte{8};  // bits a pixel
  part[9] = std::byte{3};  // numbers of a palette
  add_chunk(file, "IHDR", part);
  part.clear();
  for (const std::string& colour : colours) {
    const unsigned long rgb = std::strtoul(colour.c_str(), nullptr, 16);
    for (const int shift : {16, 8, 0}) part.push_back(static_cast<std::byte>(rgb >> shift));
  }
  add_chunk(file, "PLTE", part);
  Buffer<std::byte> plain;
  for (std::uint32_t r = 0; r < rows; ++r) {
    plain.push_back(std::byte{0});
    const auto row = std::as_bytes(pixels.subspan(std::size_t{columns} * r, columns));
    plain.insert(plain.end(), row.begin(), row.end());
  }
  uLongf size = ::compressBound(plain.size());
  part.resize(size);
  ::compress2(reinterpret_cast<Bytef*>(part.data()), &size, reinterpret_cast<const Bytef*>(plain.data()), plain.size(), 9);
  part.resize(size);
  add_chunk(file, "IDAT", part);
  add_chunk(file, "IEND", {});
  return file;
}

}  // namespace lamina::formats::png

namespace lamina::formats {
namespace {

// Deflate makes at most 1032 bytes of one (zlib's technical notes); a header that promises more lies.
constexpr std::uint64_t kMaxExpansion = 1032;

/// What libpng's callbacks see and what has to outlive a jump out of libpng.
struct ReadState {
  int file = -1;
  std::uint64_t bytes = 0;
  char message[128] = {};
  std::byte buffer[16 * 1024];
  std::size_t begin = 0, end = 0;  // unread part of buffer
  Buffer<std::byte> row;
  std::optional<RunsBuilder> builder;
  LevelSink* sink = nullptr;
  Keep keep = Keep::kRuns;
  int threshold = 0;
  std::uint32_t columns = 0;
  unsigned bits = 0;  // of a coded value
  bool palette = false;
  bool as_bits = false;  // the image is of 1 bit, and so are its rows; else they become bytes of grey or 16 bits
  int transparent = -1;  // the value of grey that is paper; -1: none
  Colours colours;       // of values of up to 8 bits
  double dpi_x = 0, dpi_y = 0;
};

void keep_error(png_structp png, png_const_charp text) {
  auto* source = static_cast<ReadState*>(png_get_error_ptr(png));
  std::strncpy(source->message, text, sizeof source->message - 1);
  png_longjmp(png, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

void read_bytes(png_structp png, png_bytep to, png_size_t count) {
  ReadState& source = *static_cast<ReadState*>(png_get_io_ptr(png));
  while (count != 0) {
    if (source.begin == source.end) {
      ssize_t got;
      do {
        got = ::read(source.file, source.buffer, sizeof source.buffer);
      } while (got < 0 && errno == EINTR);
      if (got <= 0) png_error(png, got == 0 ? "truncated" : "cannot read");
      source.begin = 0;
      source.end = static_cast<std::size_t>(got);
    }
    const std::size_t part = std::min<std::size_t>(count, source.end - source.begin);
    std::memcpy(to, source.buffer + source.begin, part);
    source.begin += part;
    to += part;
    count -= part;
  }
}

/// The brightness of the values of a palette or of grey; transparent ones are white paper.
void read_colours(png_structp png, png_infop info, ReadState& source) {
  png_bytep opaque = nullptr;
  png_color_16p transparent = nullptr;
  png_colorp palette = nullptr;
  int entries = 0, opacities = 0;
  const bool any = png_get_tRNS(png, info, &opaque, &opacities, &transparent) != 0;
  if (source.palette) {
    png_get_PLTE(png, info, &palette, &entries);
    if (entries < 1) png_error(png, "a palette without colours");
    for (int c = 0; c < entries; ++c)
      source.colours.add(palette[c].red, palette[c].green, palette[c].blue, any && c < opacities ? opaque[c] : 255);
    return;
  }
  if (any && transparent != nullptr) source.transparent = transparent->gray & ((1 << source.bits) - 1);
  if (source.bits > 8) return;
  source.colours = Colours::of_grey((1u << source.bits) - 1);
  if (source.transparent >= 0) source.colours.grey[static_cast<std::size_t>(source.transparent)] = 255;
}

/// Of 16 bits, in either order of bytes.
void whiten_transparent(std::span<std::byte> row, int transparent, bool low_byte_first) {
  const auto high = static_cast<std::byte>(transparent >> 8), low = static_cast<std::byte>(transparent);
  const std::byte first = low_byte_first ? low : high, second = low_byte_first ? high : low;
  for (std::size_t i = 0; i + 1 < row.size(); i += 2)
    if (row[i] == first && row[i + 1] == second) row[i] = row[i + 1] = std::byte{255};
}

/// A row as it is coded. returns  why not, or nullptr
const char* add_row(ReadState& source) {
  const std::uint32_t columns = source.columns;
  try {
    constexpr const char* kTooMany = "too many runs for the memory";
    if (source.as_bits) {
      if (add_bits(source.row, columns, source.colours, source.threshold, *source.builder)) return nullptr;
      return source.colours.count < 2 ? kNoColour.data() : kTooMany;
    }
    const bool wide = source.bits == 16, changed = source.bits < 8 || source.palette || source.transparent >= 0;
    if (wide && changed) whiten_transparent(source.row, source.transparent, source.sink != nullptr);
    if (!wide && changed && !widen_row(source.row, columns, source.bits, source.colours)) return kNoColour.data();
    if (source.sink != nullptr)
      return source.sink->add_row(source.row, columns, wide ? 16 : 8, false) ? nullptr : "a value is no level";
    bits_of_grey(source.row, columns, wide ? 2 : 1, false, source.threshold);
    return source.builder->add_row(std::span(source.row).first(row_bytes(columns)), false) ? nullptr : kTooMany;
  } catch (...) {
    errno = ENOMEM;
    return "out of memory";
  }
}

bool prepare(ReadState& source, std::size_t stride, std::uint32_t rows) {
  try {
    source.row.resize(stride);
    source.builder.emplace(source.columns, rows, source.keep);
    if (source.sink != nullptr && !source.as_bits) source.sink->levels.start(source.columns);
    return true;
  } catch (...) {
    errno = ENOMEM;
    return false;
  }
}

/// No object of this frame needs its destructor run when libpng jumps out.
bool read_rows(png_structp png, png_infop info, ReadState& source) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_user_limits(png, kMaxPixelsASide, kMaxPixelsASide);
  png_set_chunk_malloc_max(png, 1 << 20);
  png_set_crc_action(png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
  // Comments and colours are skipped: libpng allocates any length that they claim.
  constexpr png_byte kResolution[] = "pHYs";
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_AS_DEFAULT, kResolution, 1);
  png_read_info(png, info);
  const std::uint32_t columns = png_get_image_width(png, info), rows = png_get_image_height(png, info);
  const int colour_type = png_get_color_type(png, info);
  const bool exact = source.sink != nullptr && !source.sink->nearest, any = source.threshold > 0;
  source.columns = columns;
  source.bits = png_get_bit_depth(png, info);
  source.palette = colour_type == PNG_COLOR_TYPE_PALETTE;
  if (any && (colour_type & PNG_COLOR_MASK_ALPHA) != 0) png_error(png, "has an alpha channel; flatten it onto white");
  const bool grey = source.palette || colour_type == PNG_COLOR_TYPE_GRAY;
  if (exact && (!grey || source.bits > 8)) png_error(png, "not 8 bits of grey");
  if (!grey || (source.bits > 1 && !any && !exact)) png_error(png, any ? "neither 1-bit nor grey" : "not a 1-bit image");
  read_colours(png, info, source);
  source.as_bits = source.bits == 1 && !exact && (source.sink == nullptr || source.colours.are_black_and_white());
  if (source.sink != nullptr && source.bits == 16) png_set_swap(png);  // low byte first
  if (png_get_interlace_type(png, info) != PNG_INTERLACE_NONE) png_error(png, "interlaced images are not supported");
  const std::size_t coded_stride = (std::size_t{columns} * source.bits + 7) / 8;
  if ((coded_stride + 1) * std::uint64_t{rows} / kMaxExpansion > source.bytes) {
    png_error(png, "more pixels than a file of this size can hold");
  }
  png_uint_32 per_unit_x = 0, per_unit_y = 0;
  int unit = 0;
  if (png_get_pHYs(png, info, &per_unit_x, &per_unit_y, &unit) != 0 && unit == PNG_RESOLUTION_METER) {
    source.dpi_x = per_unit_x * 0.0254;
    source.dpi_y = per_unit_y * 0.0254;
  }
  if (!prepare(source, source.as_bits ? coded_stride : std::max<std::size_t>(coded_stride, columns), rows))
    png_error(png, "out of memory");
  for (std::uint32_t r = 0; r < rows; ++r) {
    png_read_row(png, reinterpret_cast<png_bytep>(source.row.data()), nullptr);
    if (const char* wrong = add_row(source); wrong != nullptr) png_error(png, wrong);
  }
  png_read_end(png, nullptr);
  return true;
}

}  // namespace

Result<Image> read_png(int file, std::uint64_t bytes, const std::string& path, int threshold, LevelSink* sink, Keep keep) {
  const auto source = std::make_unique<ReadState>();
  source->file = file;
  source->bytes = bytes;
  source->sink = sink;
  source->threshold = threshold;
  source->keep = keep;
  png_structp reader = png_create_read_struct(PNG_LIBPNG_VER_STRING, source.get(), keep_error, ignore_warning);
  png_infop info = reader != nullptr ? png_create_info_struct(reader) : nullptr;
  bool whole = false;
  if (info != nullptr) {
    png_set_read_fn(reader, source.get(), read_bytes);
    whole = read_rows(reader, info, *source);
  }
  png_destroy_read_struct(&reader, &info, nullptr);
  if (!whole) {
    return Error{Fault::kVerification, fmt::format("{}: not a whole {}PNG: {}; plan the layer again", path,
                                                   threshold > 0 || sink != nullptr ? "" : "1-bit ", source->message)};
  }
  return image_of(*source->builder, source->columns, source->dpi_x, source->dpi_y);
}

}  // namespace lamina::formats
