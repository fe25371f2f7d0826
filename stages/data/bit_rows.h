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

/// A row whose words are mostly empty or full: spans of words that are not empty, in order, and the words of those that are
/// not full either. Scratch; keeps its capacity.
struct WordSpans {
  struct WordSpan {
    std::uint32_t first, end;
    bool full;
  };
  Buffer<WordSpan> span;
  Buffer<std::uint64_t> mixed;
  std::uint64_t bytes() const { return bytes_held(span) + bytes_held(mixed); }

  /// Appends word number `at`, behind all before it.
  void add(std::uint32_t at, std::uint64_t word) {
    if (word == 0) return;
    const bool full = word == ~std::uint64_t{0};
    if (!full) mixed.push_back(word);
    add_span(at, at + 1, full);
  }
  void add_span(std::uint32_t first, std::uint32_t end, bool full) {
    if (first == end) return;
    if (!span.empty() && span.back().end == first && span.back().full == full) {
      span.back().end = end;
    } else {
      span.push_back({first, end, full});
    }
  }
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
  /// Whether its rows are best read as spans: most words are empty or full.
  virtual bool has_spans() const { return false; }
  /// Of an image that has them. spans  what the row is replaces what they were. cost  O(runs and mixed words)
  virtual void spans(std::uint32_t, WordSpans&) const {}
  /// Words of a row.
  std::uint32_t words() const { return (columns() + 63) / 64; }
};

}  // namespace lamina
