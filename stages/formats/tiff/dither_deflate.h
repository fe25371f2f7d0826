// stages/formats/tiff/dither_deflate.h: deflate of dithered 1-bit images, whose rows repeat at known distances.
//
// The blue-noise tile is 128 pixels wide (stages/dose/blue_noise.h), and its rows repeat after 128 rows, out of reach of
// deflate's window: the only distance is 16, at which empty areas repeat too. A core (stages/dose/dither.h) nearly repeats after
// some rows and columns. Bytes that repeat at no distance are literals in a code of each strip. Sources: RFC 1951 (deflate), RFC 1950 (zlib), TIFF 6.0 and its Technical Note 2 (compression 8).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/bit_rows.h"
#include "stages/formats/png/deflate.h"

namespace lamina::formats::tiff {

/// A distance of a match, and how deflate states it (RFC 1951, 3.2.5).
struct DitherDistance {
  std::size_t bytes;
  std::uint32_t symbol, extra, extra_bits;
  png::BitString word;  // of the strip's code
};

/// One compressor per thread; keeps its scratch.
class DitherDeflate {
 public:
  /// Upper bound of a stream: no code of all symbols takes more than 9 bits a symbol.
  static constexpr std::size_t bound(std::size_t bytes) { return bytes + bytes / 4 + 1024; }

  /// Writes the zlib stream of `bytes` to `out`, which has bound() bytes. returns  those written
  /// stride  bytes of a row
  /// set     spans in order and apart; all bytes outside of them are 0
  /// cost    a few reads of the spans, and two more of the bytes that do not repeat
  std::size_t compress(std::span<const std::byte> bytes, std::size_t stride, std::span<const RowSpan> set, std::byte* out);

 private:
  struct Piece {
    std::uint32_t literals, match;  // so many bytes, and then a match of so many
    std::uint32_t distance;         // number of its distance
  };
  struct DitherMatch {
    const std::byte* end;
    std::uint32_t distance;
  };
  void find_parts(std::size_t size, std::span<const RowSpan> set);
  void choose_distances(std::span<const std::byte> bytes, std::size_t stride);
  void add_distance(std::size_t bytes);
  DitherMatch longest_match(std::span<const std::byte> bytes, const std::byte* at, std::size_t& part) const;
  bool is_new(std::span<const std::byte> bytes, const std::byte* at) const;
  void find_pieces(std::span<const std::byte> bytes);
  void make_code();
  void put_head(png::BitWriter& writer) const;
  void put_pieces(std::span<const std::byte> bytes, png::BitWriter& writer) const;

  Buffer<RowSpan> parts_;
  static constexpr std::size_t kMaxDistances = 3, kDistanceSymbols = 30;
  std::array<DitherDistance, kMaxDistances> distance_{};  // the first one repeats what is empty
  std::size_t distances_ = 0;
  std::array<std::uint8_t, kDistanceSymbols> distance_lengths_{};
  std::vector<Piece> pieces_;
  std::array<std::uint32_t, png::kSymbols> weights_{};
  std::array<std::uint8_t, png::kSymbols> lengths_{};
  std::array<png::BitString, 256> byte_{};
  std::array<png::BitString, png::kLongestMatch + 1> match_{};
  png::BitString end_;
};

}  // namespace lamina::formats::tiff
