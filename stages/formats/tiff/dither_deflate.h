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

#include "stages/formats/tiff/strip_code.h"

namespace lamina::formats::tiff {

/// One compressor per thread; keeps its scratch.
class DitherDeflate {
 public:
  /// Writes the zlib stream of `bytes` to `out`, which has StripCode::bound() bytes. returns  those written
  /// cost  one read of the bytes, and two more of those that do not repeat
  std::size_t compress(std::span<const std::byte> bytes, std::byte* out);

 private:
  struct Piece {
    std::uint32_t literals, match;  // so many bytes, and then a match of so many
  };
  void find_pieces(std::span<const std::byte> bytes);

  std::vector<Piece> pieces_;
  StripWeights weights_{};
  StripCode code_{false};
};

}  // namespace lamina::formats::tiff
