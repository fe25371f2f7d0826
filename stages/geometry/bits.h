// stages/geometry/bits.h: between runs, words and rows of bits, the leftmost pixel in the highest bit of the first byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "stages/data/bit_image.h"
#include "stages/data/bit_rows.h"
#include "stages/data/runs.h"
#include "stages/data/units.h"
#include "stages/geometry/targets.h"

namespace lamina {

/// A side of the largest bed at the finest dpi (data/units.h, data/grid.h): no writer makes, and no reader believes,
/// more columns or rows. A row of bits is then at most 268,436 bytes.
inline constexpr std::uint32_t kMaxPixelsASide =
    static_cast<std::uint32_t>(ceil_div(kNmReach * std::int64_t{25'400}, kNmPerInch));

constexpr std::size_t row_bytes(std::uint32_t columns) { return (std::size_t{columns} + 7) / 8; }

/// Swaps the bits of each byte, first and last.
LAMINA_BODY constexpr std::uint64_t turn_bytes(std::uint64_t word) {
  word = (word & 0xF0F0F0F0F0F0F0F0) >> 4 | (word & 0x0F0F0F0F0F0F0F0F) << 4;
  word = (word & 0xCCCCCCCCCCCCCCCC) >> 2 | (word & 0x3333333333333333) << 2;
  return (word & 0xAAAAAAAAAAAAAAAA) >> 1 | (word & 0x5555555555555555) << 1;
}

/// Sets the bits of the runs of one row; all others, those after the last column too, become 0.
/// change  as in data/runs.h; row  row_bytes(columns) bytes
/// cost    a fill of the row and a few operations a run
void expand_row(std::span<const std::uint32_t> change, std::span<std::byte> row);
/// The same of a row of words (data/bit_rows.h), whose other bits stay.
void add_runs(std::span<const std::uint32_t> change, std::span<std::uint64_t> words);

/// From words to bits. row  row_bytes(columns) bytes
void bits_of_words(std::span<const std::uint64_t> words, std::span<std::byte> row);
/// From bits, inverted if `flip` is all ones, to words; bits after the last column become 0.
void words_of_bits(std::span<const std::byte> row, std::uint32_t columns, std::uint64_t flip, std::span<std::uint64_t> words);

/// Swaps left and right.
void reverse_row(std::span<std::uint64_t> words, std::uint32_t columns);

/// Borrowed rows of a 1-bit image as runs: of runs, or of bits, whose rows become runs when they are read.
class RowRuns {
 public:
  RowRuns(const RunsView& runs) : columns_(runs.columns), rows_(runs.rows()), runs_(runs) {}
  RowRuns(const Runs& runs) : RowRuns(runs.view()) {}
  RowRuns(const BitRows& bits) : columns_(bits.columns()), rows_(bits.rows()), bits_(&bits) {}

  std::uint32_t columns() const { return columns_; }
  std::uint32_t rows() const { return rows_; }
  /// Changes of a row (data/runs.h); valid until a row is read whose number differs by an even number.
  std::span<const std::uint32_t> row(std::uint32_t number) { return bits_ == nullptr ? runs_.row(number) : read(number); }
  /// What it borrows, if that is runs.
  const RunsView* runs() const { return bits_ == nullptr ? &runs_ : nullptr; }

 private:
  struct Row {
    std::uint32_t number = UINT32_MAX;
    std::size_t used = 0;
    Buffer<std::uint32_t> change;
  };
  std::span<const std::uint32_t> read(std::uint32_t number);

  std::uint32_t columns_, rows_;
  RunsView runs_;
  const BitRows* bits_ = nullptr;
  std::array<Row, 2> read_;
  Buffer<std::uint64_t> words_;
};

/// The same as rows of bits.
class RowBits {
 public:
  RowBits(const RunsView& runs) : columns(runs.columns), rows(runs.rows()), runs_(runs) {}
  RowBits(const BitRows& bits) : columns(bits.columns()), rows(bits.rows()), bits_(&bits), words_(bits.words()) {}

  /// row  row_bytes(columns) bytes
  void put(std::uint32_t number, std::span<std::byte> row);
  /// The same of a row whose bytes are 0. Appends the spans of bytes in which bits may be set, in order and apart.
  void put_set(std::uint32_t number, std::span<std::byte> row, Buffer<RowSpan>& spans);

  const std::uint32_t columns, rows;

 private:
  RunsView runs_;
  const BitRows* bits_ = nullptr;
  Buffer<std::uint64_t> words_;
  Buffer<RowSpan> set_;
};

PixelCounts counts_of(const BitRows& image);

/// Collects rows of bits as runs.
class RunsBuilder {
 public:
  /// rows  of the image; needed for kSmaller
  explicit RunsBuilder(std::uint32_t columns, std::uint32_t rows = 0, Keep keep = Keep::kRuns);

  /// Set bits are pixels, or clear bits if `invert`. Bits after the last column are ignored.
  /// row    row_bytes(columns) bytes
  /// false  if the image has 2^32 changes or more, which runs cannot hold
  /// cost   one read of each 64 bits, and a few operations a change
  bool add_row(std::span<const std::byte> row, bool invert);
  /// The same of a row of runs.
  bool add_changes(std::span<const std::uint32_t> change);

  /// All rows of an image; takes them where they are the first ones.
  bool add_all(Runs& rows);

  /// Nothing if they are kept as bits or counts.
  Runs finish();
  /// After finish(): the image, if its runs would be larger.
  std::optional<BitImage> take_bits() { return std::move(bits_); }
  const PixelCounts& counts() const { return counts_; }
  std::uint32_t rows() const { return next_; }

 private:
  bool end_row(std::size_t used);
  void keep_smaller();

  Runs runs_;
  std::size_t used_ = 0;  // of runs_.change, which is kept larger
  Keep keep_;
  std::uint32_t rows_, next_ = 0;
  std::optional<BitImage> bits_;
  PixelCounts counts_;
};

}  // namespace lamina
