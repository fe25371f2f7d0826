// stages/formats/tiff/strip_matches.h: matches of a strip at a few known distances, without a search.
//
// For each distance a mask has the bytes that repeat there. Operations on whole words keep its long runs and give each byte to
// one distance: no step waits for the end of a match before it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/formats/tiff/strip_code.h"

namespace lamina::formats::tiff {

/// So many literals, and then a match of so many bytes, if any. distance  its number
struct StripPiece {
  std::uint32_t literals, match, distance;
};

/// Part [begin, end) of a strip.
struct StripPart {
  std::span<const std::byte> strip;
  std::span<const StripDistance> distances;  // the first one is 1
  std::size_t begin, end;
};

/// Scratch; keeps its capacity.
class StripMatches {
 public:
  /// Appends the matches of a part. A first one that continues the last piece becomes part of it.
  /// literals  first byte that is in no piece yet. returns  that after the part
  /// cost      some 20 operations for 64 bytes and a distance, and a few a match
  std::size_t add(const StripPart& part, std::size_t literals, Buffer<StripPiece>& pieces);

 private:
  Buffer<std::uint64_t> masks_;
  Buffer<std::uint32_t> begin_, end_;  // of matches
};

}  // namespace lamina::formats::tiff
