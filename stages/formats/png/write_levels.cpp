// PNG of 8-bit grey, in which 0, black, is a full voxel (PNG specification, second edition, 11.2.2).
//
// Rows have no filter and one block of deflate's fixed code: equal bytes are a literal and matches of distance 1 (RFC 1951,
// 3.2.5, 3.2.6), so that the bytes depend on no library.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "stages/formats/level_format.h"
#include "stages/formats/png/bit_writer.h"
#include "stages/formats/png/chunk.h"
#include "stages/formats/png/huffman.h"
#include "stages/formats/png/png_format.h"
#include "stages/geometry/bits.h"

namespace lamina::write::png {
namespace {

constexpr std::uint32_t kMostEqual = 258, kEndOfBlock = 256, kLengthOf258 = 285;

constexpr std::array<std::uint8_t, 288> fixed_lengths() {
  std::array<std::uint8_t, 288> lengths{};
  for (std::size_t s = 0; s < lengths.size(); ++s) lengths[s] = s < 144 ? 8 : s < 256 ? 9 : s < 280 ? 7 : 8;
  return lengths;
}
constexpr auto kFixed = words_of(fixed_lengths());

/// A match of `length` 3 .. 257 bytes of distance 1, whose own word is five zeros.
constexpr Word match_word(std::uint32_t length) {
  std::uint32_t symbol = 257, base = 3, extra = 0;
  for (;; ++symbol) {
    extra = symbol < 265 ? 0 : (symbol - 261) / 4;
    if (length < base + (1u << extra)) break;
    base += 1u << extra;
  }
  return join(join(kFixed[symbol], Word(length - base, extra)), Word(0, 5));
}
constexpr std::array<Word, kMostEqual + 1> match_words() {
  std::array<Word, kMostEqual + 1> words{};
  for (std::uint32_t length = 3; length < kMostEqual; ++length) words[length] = match_word(length);
  words[kMostEqual] = join(kFixed[kLengthOf258], Word(0, 5));
  return words;
}
constexpr auto kMatch = match_words();

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
    const auto failure = [&](std::string_view why) {
      return Error{Fault::kOutput,
                   fmt::format("PNG cannot hold a layer of {} x {} pixels: {}", image.columns, image.rows(), why)};
    };
    if (image.columns == 0 || image.rows() == 0) return failure("it has no pixels");
    if (image.columns > kMostPixelsASide || image.rows() > kMostPixelsASide) {
      return failure(fmt::format("a side has at most {} pixels", kMostPixelsASide));
    }
    if (full == 0 || 255 % full != 0) return failure(fmt::format("{} levels are no whole steps of 8 bits", full + 1));
    file.resize(std::max<std::size_t>(file.capacity(), 4096));
    const std::size_t data = put_head(image, dpi_x, dpi_y, file);
    chunk_ = data;
    BitWriter out(file.data() + chunk_ + kChunkHead);
    out.put(0x0178, 16);  // zlib's header: deflate, a window of 32 KiB, the fastest level
    out.put(0b011, 3);    // the last block, of the fixed code
    check_ = Check();
    for (std::uint32_t r = 0; r < image.rows(); ++r) {
      put(0, 1, out, file);  // no filter
      std::uint32_t at = 0;
      for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i) {
        put(255, image.change[2 * i] - at, out, file);
        at = image.change[2 * i + 1];
        put(255u - image.level[i] * (255u / full), at - image.change[2 * i], out, file);
      }
      put(255, image.columns - at, out, file);
    }
    make_room(out, file);
    out.put(kFixed[kEndOfBlock]);
    std::byte* end = close_chunk(file.data() + chunk_, put_number(out.finish(), check_.value()), "IDAT");
    const std::size_t last = static_cast<std::size_t>(end - file.data());
    file.resize(last + kChunkHead + kChunkTail);
    close_chunk(file.data() + last, file.data() + last + kChunkHead, "IEND");
    return {};
  }

 private:
  static constexpr std::size_t kSlack = 128, kChunkContent = std::size_t{1} << 16;

  static std::size_t put_head(const LevelsView& image, double dpi_x, double dpi_y, Bytes& file) {
    using namespace std::string_view_literals;
    const auto text = [](std::byte* at, std::string_view bytes) {
      std::memcpy(at, bytes.data(), bytes.size());
      return at + bytes.size();
    };
    std::byte* chunk = text(file.data(), "\x89PNG\r\n\x1A\n"sv);
    std::byte* at = put_number(put_number(chunk + kChunkHead, image.columns), image.rows());
    chunk = close_chunk(chunk, text(at, "\x08\0\0\0\0"sv), "IHDR");  // 8 bits, grey, deflate, filters, not interlaced
    at = put_number(put_number(chunk + kChunkHead, per_metre(dpi_x)), per_metre(dpi_y));
    *at++ = std::byte{1};
    return static_cast<std::size_t>(close_chunk(chunk, at, "pHYs") - file.data());
  }
  /// Pixels a metre, as pHYs has them, rounded to the nearest.
  static std::uint32_t per_metre(double dpi) { return static_cast<std::uint32_t>((dpi * 10'000 + 127) / 254); }

  /// Closes a chunk that is long enough, and makes room for some words.
  void make_room(BitWriter& out, Bytes& file) {
    std::size_t used = static_cast<std::size_t>(out.next() - file.data());
    if (used - chunk_ < kChunkContent && used + kSlack <= file.size()) return;
    if (file.size() < used + 2 * kSlack) file.resize(2 * file.size() + 2 * kSlack);
    if (used - chunk_ >= kChunkContent) {
      chunk_ = static_cast<std::size_t>(close_chunk(file.data() + chunk_, file.data() + used, "IDAT") - file.data());
      used = chunk_ + kChunkHead;
    }
    out.move_to(file.data() + used);
  }

  void put(std::uint32_t byte, std::uint64_t count, BitWriter& out, Bytes& file) {
    if (count == 0) return;
    check_.add(byte, count);
    make_room(out, file);
    out.put(kFixed[byte]);
    for (--count; count > 0;) {
      make_room(out, file);
      const auto length = static_cast<std::uint32_t>(std::min<std::uint64_t>(count, kMostEqual));
      if (length < 3) {
        for (std::uint32_t i = 0; i < length; ++i) out.put(kFixed[byte]);
      } else {
        out.put(kMatch[length]);
      }
      count -= length;
    }
  }

  std::size_t chunk_ = 0;  // where it begins
  Check check_;
};

}  // namespace

std::unique_ptr<LevelEncoder> make_8_bit_encoder() { return std::make_unique<GreyEncoder>(); }

}  // namespace lamina::write::png
