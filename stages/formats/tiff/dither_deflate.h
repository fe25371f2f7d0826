// stages/formats/tiff/dither_deflate.h: deflate of dithered 1-bit images, whose rows repeat every 16 bytes.
//
// The blue-noise tile is 128 pixels wide (stages/dose/blue_noise.h), and its rows repeat after 128 rows, out of reach of
// deflate's window. So the only distance is 16, at which empty areas repeat too, and bytes that differ are literals in a code
// of each strip. Sources: RFC 1951 (deflate), RFC 1950 (zlib), TIFF 6.0 and its Technical Note 2 (compression 8).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/formats/png/deflate.h"

namespace lamina::formats::tiff {

/// One compressor per thread; keeps its scratch.
class DitherDeflate {
 public:
  /// Upper bound of a stream: no code of all symbols takes more than 9 bits a symbol.
  static constexpr std::size_t bound(std::size_t bytes) { return bytes + bytes / 4 + 1024; }

  /// Writes the zlib stream of `bytes` to `out`, which has bound() bytes. returns  those written
  /// cost  one read of the bytes, and two more of those that do not repeat
  std::size_t compress(std::span<const std::byte> bytes, std::byte* out);

 private:
  struct Piece {
    std::uint32_t literals, match;  // so many bytes, and then a match of so many
  };
  void find_pieces(std::span<const std::byte> bytes);
  void make_code();
  void put_head(png::BitWriter& writer) const;
  void put_pieces(std::span<const std::byte> bytes, png::BitWriter& writer) const;

  std::vector<Piece> pieces_;
  std::array<std::uint32_t, png::kSymbols> weights_{};
  std::array<std::uint8_t, png::kSymbols> lengths_{};
  std::array<png::BitString, 256> byte_{};
  std::array<png::BitString, png::kLongestMatch + 1> match_{};
  png::BitString end_;
};

}  // namespace lamina::formats::tiff
