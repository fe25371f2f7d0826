// stages/formats/png/filtered_rows.h: rows of bits as what differs from the rows above them, deflated.
//
// A white row and a row below a white one have filter 0 (none), all others filter 2 (Up; PNG specification, section 9.2).
// So bytes are 0 but where a row changes, and an interval of white rows consists of zeros only. Zeros are never read: they are
// the distance between two bytes that are not 0.
#pragma once

#include <cstdint>
#include <span>

#include "stages/formats/png/deflate.h"

namespace lamina::formats::png {

/// Adler-32 (RFC 1950, section 8.2) of rows of one length. Its second sum counts each byte as often as there are bytes from
/// it to the end of the stream, so rows can be added up one by one, and zeros need not be.
class Adler32 {
 public:
  Adler32(std::uint64_t row_bytes, std::uint64_t rows) : row_bytes_(row_bytes), rows_(rows) {}

  /// values     sum of the bytes of a row; at most 2^27
  /// moments    sum of each of them times the bytes before it in the row; at most 2^45
  /// rows_left  this one and those below
  void add(std::uint64_t values, std::uint64_t moments, std::uint64_t rows_left) {
    values_ += values;
    weighted_ += values * rows_left;
    moments_ += moments;
    if (((weighted_ | moments_) >> 62) != 0) weighted_ %= kPrime, moments_ %= kPrime;
  }

  std::uint32_t value() const {
    const std::uint64_t length = row_bytes_ * rows_ % kPrime, first = (1 + values_) % kPrime;
    const std::uint64_t second = (length + weighted_ % kPrime * row_bytes_ + kPrime - moments_ % kPrime) % kPrime;
    return static_cast<std::uint32_t>(second << 16 | first);
  }

 private:
  static constexpr std::uint64_t kPrime = 65521;
  std::uint64_t row_bytes_, rows_;
  std::uint64_t values_ = 0, weighted_ = 0, moments_ = 0;
};

class FilteredRows {
 public:
  FilteredRows(const Codes& codes, std::uint32_t columns, std::uint32_t rows);

  /// Bytes that so many zeros take at most.
  static std::size_t max_bytes_of_zeros(std::uint64_t zeros) { return static_cast<std::size_t>(zeros / 128 + 32); }
  /// Bytes that put() writes at most for this many changes of a row and of the one above.
  std::size_t max_bytes(std::size_t changes) const {
    return 9 * changes + max_bytes_of_zeros(kMaxWaiting) + max_bytes_of_zeros(row_bytes_);
  }
  /// Zeros that wait to be written before this row.
  std::uint64_t waiting(std::uint32_t row) const { return row * row_bytes_ - written_; }
  /// Writes this many of them.
  void put_zeros(BitWriter& out, std::uint64_t zeros);

  /// Row number `r`, which is not white. Rows come from the top; white ones are left out.
  /// needs  at most kMaxWaiting zeros before the row
  static constexpr std::uint64_t kMaxWaiting = 32 * 1024;
  void put(BitWriter& out, std::uint32_t r, std::span<const std::uint32_t> row, std::span<const std::uint32_t> above);

  std::uint32_t check() const { return check_.value(); }

 private:
  const Codes& codes_;
  std::uint64_t row_bytes_;  // of the stream: the filter's, then those of bits
  std::uint32_t rows_;
  std::uint64_t written_ = 0;
  Adler32 check_;
};

}  // namespace lamina::formats::png
