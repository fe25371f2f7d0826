// stages/formats/tiff/dither_deflate.h: deflate of dithered 1-bit images, whose rows repeat at known distances.
//
// The blue-noise tile is 128 pixels wide (stages/dose/blue_noise.h), and its rows repeat after 128 rows, out of reach of
// deflate's window: the only distances are 16, and 1 for what is empty or full. A core (stages/dose/dither.h) nearly repeats
// after some rows and columns. Bytes that repeat at no distance are literals in a code of each strip. Sources: RFC 1951
// (deflate), RFC 1950 (zlib), TIFF 6.0 and its Technical Note 2 (compression 8).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/bit_rows.h"
#include "stages/formats/tiff/strip_code.h"
#include "stages/formats/tiff/strip_matches.h"
#include "stages/geometry/bits.h"

namespace lamina::formats::tiff {

/// One compressor per thread; keeps its scratch.
class DitherDeflate {
 public:
  /// Before the rows of an image.
  void start() { strip_.clear(); }
  /// As compress(), of the rows [begin, end), which are no more than those of the image's first strip.
  std::size_t compress_rows(RowBits& image, std::uint32_t begin, std::uint32_t end, std::size_t stride, std::byte* out);

  /// Writes the zlib stream of `bytes` to `out`, which has StripCode::bound() bytes. returns  those written
  /// stride  bytes of a row
  /// set     spans in order and apart; all bytes outside of them are 0
  /// cost    a few reads of the spans, and two more of the bytes that do not repeat
  std::size_t compress(std::span<const std::byte> bytes, std::size_t stride, std::span<const RowSpan> set, std::byte* out);

 private:
  void find_parts(std::size_t size, std::span<const RowSpan> set);
  void choose_distances(std::span<const std::byte> bytes, std::size_t stride);
  void find_pieces(std::span<const std::byte> bytes);

  Buffer<std::byte> strip_;
  Buffer<RowSpan> set_;  // of the strip, where it is not 0
  Buffer<RowSpan> parts_;
  Buffer<StripPiece> pieces_;
  StripMatches matches_;
  StripCode code_;  // its first distance repeats what is empty
};

}  // namespace lamina::formats::tiff
