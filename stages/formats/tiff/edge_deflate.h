// stages/formats/tiff/edge_deflate.h: deflate of 1-bit images whose edges alone are dithered, from the spans of their rows.
//
// Equal bytes, 0 or 255, are a match at distance 1, words of a blue-noise tile at distance 16; all other bytes are literals in a
// code of each strip. So the cost depends on edges, not on pixels. Sources: RFC 1951 (deflate), RFC 1950 (zlib), TIFF 6.0 and its Technical Note 2 (compression 8).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/bit_rows.h"
#include "stages/data/buffer.h"
#include "stages/formats/tiff/strip_code.h"

namespace lamina::formats::tiff {

/// One strip after the other; keeps its scratch.
class EdgeDeflate {
 public:
  EdgeDeflate();
  void start();
  /// bytes  of the row
  void add(const WordSpans& row, std::size_t bytes);
  /// Writes the zlib stream of the strip to `out`, which has StripCode::bound() of its bytes. returns  those written
  std::size_t finish(std::byte* out);
  std::uint64_t bytes() const { return bytes_held(literals_) + bytes_held(pieces_); }

 private:
  /// So many literals, and then a match of so many.
  struct EdgePiece {
    std::uint32_t literals, match;
    bool far;
  };
  void add_equal(bool full, std::size_t count);
  void add_word(std::uint64_t word, std::size_t bytes);
  void add_repeated(std::uint64_t word, std::size_t bytes);
  void end_equal();
  void sum(const std::byte* at, std::size_t count);
  void put_literals(std::uint64_t bytes, std::size_t count);

  Buffer<std::byte> literals_;  // of the strip; 8 more than used
  Buffer<EdgePiece> pieces_;
  std::size_t used_ = 0, taken_ = 0;  // literals; those in pieces
  bool full_ = false;                 // equal bytes that wait: 255, or 0
  std::size_t equal_ = 0;             // their number
  std::uint64_t sum_ = 1, sums_ = 0;  // Adler's (RFC 1950)
  std::array<std::array<std::uint32_t, 256>, 2> counts_;
  StripCode code_;
};

}  // namespace lamina::formats::tiff
