// stages/data/bit_rows.h: a 1-bit image whose rows are computed when they are read, so that no whole image exists.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"

namespace lamina {

/// Elements [begin, end) of a row: words or bytes.
struct RowSpan {
  std::size_t begin = 0, end = 0;
};

/// Rows of a 1-bit image, from the first one of the image (largest y). Const, usable from any thread.
class BitRows {
 public:
  virtual ~BitRows() = default;
  virtual std::uint32_t columns() const = 0;
  virtual std::uint32_t rows() const = 0;
  /// words  bit c % 64 of word c / 64 is column c; (columns + 63) / 64 words, all of which are written; bits past the last
  ///        column are 0
  virtual void row(std::uint32_t number, std::span<std::uint64_t> words) const = 0;
  /// Writes only the words in which bits may be set, and appends their spans, in order and apart. Others stay as they are.
  virtual void set_words(std::uint32_t number, std::span<std::uint64_t> words, Buffer<RowSpan>& spans) const {
    row(number, words);
    spans.push_back({0, words.size()});
  }
  /// Words of a row.
  std::uint32_t words() const { return (columns() + 63) / 64; }
};

}  // namespace lamina
