// stages/formats/tiff/packbits.h: PackBits (TIFF 6.0, section 9) of rows that are given as runs of equal bytes: the bytes that
// libtiff makes of the same rows. The cost depends on the runs, and one of 128 bytes counts as one.
#pragma once

#include <cstddef>
#include <cstdint>

#include "stages/data/levels.h"
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

/// A row of levels as bytes: `step` times the level.
inline void put_bytes(const LevelsView& image, std::uint32_t row, unsigned step, PackBits& to) {
  std::uint32_t at = 0;
  for (std::uint32_t i = image.row_offset[row]; i < image.row_offset[row + 1]; ++i) {
    const std::uint32_t begin = image.change[2 * i], end = image.change[2 * i + 1];
    to.add(0, begin - at);
    to.add(static_cast<std::uint8_t>(image.level[i] * step), end - begin);
    at = end;
  }
  to.add(0, image.columns - at);
}

/// The same as half bytes; the left pixel of two is in the high bits.
inline void put_nibbles(const LevelsView& image, std::uint32_t row, unsigned step, PackBits& to) {
  unsigned value = 0;       // of the run of bytes that is not added yet
  std::uint32_t count = 0;  // and its length
  unsigned half = 0;        // a left pixel
  const auto add = [&](unsigned next, std::uint32_t bytes) {
    if (next != value) to.add(static_cast<std::uint8_t>(value), count), value = next, count = 0;
    count += bytes;
  };
  std::uint32_t at = 0;
  const auto fill = [&](unsigned level, std::uint32_t end) {
    if (at % 2 != 0 && at < end) add(half << 4 | level, 1), ++at;
    if ((end - at) / 2 > 0) add(level * 17, (end - at) / 2);
    if ((end - at) % 2 != 0) half = level;
    at = end;
  };
  for (std::uint32_t i = image.row_offset[row]; i < image.row_offset[row + 1]; ++i) {
    fill(0, image.change[2 * i]);
    fill(image.level[i] * step, image.change[2 * i + 1]);
  }
  fill(0, image.columns + image.columns % 2);
  to.add(static_cast<std::uint8_t>(value), count);
}

}  // namespace lamina::formats::tiff
