// stages/formats/tiff/packbits.h: PackBits (TIFF 6.0, section 9) of rows that are given as runs of equal bytes: the bytes that
// libtiff makes of the same rows. The cost depends on the runs, and one of 128 bytes counts as one.
#pragma once

#include <cstddef>
#include <cstdint>

#include "stages/formats/image_format.h"

namespace lamina::formats::tiff {

/// Appends encoded rows to bytes; no run or literal goes from one row to the next.
class PackBits {
 public:
  void start() { size_ = 0; }
  /// bytes  of the row when it is not encoded
  void start_row(std::size_t bytes) {
    const std::size_t maximum = size_ + 2 * bytes + 2;
    if (bytes_.size() < maximum) bytes_.resize(2 * maximum);
    state_ = PackState::kBase;
  }
  /// The run of another byte than the one before it in the row.
  void add(std::uint8_t value, std::size_t count) {
    if (count == 0) return;
    if (state_ == PackState::kLiteralRun) join(count);
    for (; count > 128; count -= 128) put_run(value, 128);
    if (count > 1) return put_run(value, count);
    if (state_ == PackState::kLiteralRun) state_ = PackState::kRun;
    if (state_ != PackState::kLiteral) {
      literal_ = size_;
      put(0), put(value);
      state_ = PackState::kLiteral;
      return;
    }
    if (lengthened(1) == kLongest) state_ = PackState::kBase;
    put(value);
  }
  std::size_t size() const { return size_; }
  std::byte* data() { return bytes_.data(); }

 private:
  enum class PackState : std::uint8_t { kBase, kLiteral, kRun, kLiteralRun };
  static constexpr int kLongest = 127;  // of a literal: its bytes, less one

  void put(std::uint8_t value) { bytes_[size_++] = std::byte{value}; }
  void put_run(std::uint8_t value, std::size_t count) {
    put(static_cast<std::uint8_t>(257 - count)), put(value);
    state_ = state_ == PackState::kLiteral ? PackState::kLiteralRun : PackState::kRun;
  }
  int lengthened(int by) {
    const int length = static_cast<int>(bytes_[literal_]) + by;
    bytes_[literal_] = static_cast<std::byte>(length);
    return length;
  }
  /// A single byte after a literal and two equal bytes: those become part of the literal if it stays short enough.
  void join(std::size_t count) {
    constexpr std::byte kTwo{255};
    if (count != 1 || bytes_[size_ - 2] != kTwo || static_cast<int>(bytes_[literal_]) >= kLongest - 1) {
      state_ = PackState::kRun;
      return;
    }
    state_ = lengthened(2) == kLongest ? PackState::kBase : PackState::kLiteral;
    bytes_[size_ - 2] = bytes_[size_ - 1];
  }

  Bytes bytes_;
  std::size_t size_ = 0, literal_ = 0;  // where the last literal begins
  PackState state_ = PackState::kBase;
};

}  // namespace lamina::formats::tiff
