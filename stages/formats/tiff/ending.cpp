#include "stages/formats/tiff/ending.h"

#include <tiff.h>

#include <array>
#include <cstring>

namespace lamina::write::tiff {
namespace {

constexpr std::size_t kStripAt = 8, kDirectoryAt = 4, kEntryBytes = 12, kMostTail = 1024;

template <class Number>
Number number_at(std::span<const std::byte> bytes, std::size_t at) {
  Number value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

template <class Number>
void put_at(std::byte* bytes, std::size_t at, Number value) {
  std::memcpy(bytes + at, &value, sizeof value);
}

/// Bytes of a value of a type; 0: no type of TIFF 6.0.
std::size_t bytes_of(std::uint16_t type) {
  constexpr std::array<std::uint8_t, 13> kBytes = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8};
  return type < kBytes.size() ? kBytes[type] : 0;
}

/// libtiff begins what stands behind a strip at an even byte.
std::size_t even(std::size_t at) { return (at + 1) & ~std::size_t{1}; }

}  // namespace

bool Ending::find_fields(std::span<const std::byte> file, std::size_t strip_end) {
  tail_at_ = even(strip_end);
  if (file.size() < tail_at_ + 2 || file.size() > tail_at_ + kMostTail) return false;
  const std::size_t directory = number_at<std::uint32_t>(file, kDirectoryAt);
  if (directory < tail_at_ || directory + 2 > file.size()) return false;
  const std::size_t entries = number_at<std::uint16_t>(file, directory);
  if (directory + 2 + entries * kEntryBytes > file.size()) return false;
  places_.clear();
  length_at_ = 0;
  for (std::size_t e = 0; e < entries; ++e) {
    const std::size_t at = directory + 2 + e * kEntryBytes, value = at + 8;
    const auto tag = number_at<std::uint16_t>(file, at), type = number_at<std::uint16_t>(file, at + 2);
    const std::size_t bytes = bytes_of(type) * number_at<std::uint32_t>(file, at + 4);
    if (bytes == 0) return false;
    if (tag == TIFFTAG_STRIPBYTECOUNTS) {
      if (type != TIFF_SHORT && type != TIFF_LONG) return false;
      length_at_ = value - tail_at_;
      short_length_ = type == TIFF_SHORT;
    } else if (bytes > 4) {
      const std::size_t offset = number_at<std::uint32_t>(file, value);
      if (offset < tail_at_ || offset + bytes > file.size()) return false;
      places_.push_back(value - tail_at_);
    }
    if ((tag == TIFFTAG_STRIPBYTECOUNTS || tag == TIFFTAG_STRIPOFFSETS) && bytes > 4) return false;
  }
  return length_at_ != 0;
}

void Ending::take(const Image& image, std::span<const std::byte> file, std::size_t strip_end) {
  tail_.clear();
  if (!find_fields(file, strip_end)) return;
  image_ = image;
  head_.assign(file.begin(), file.begin() + kStripAt);
  tail_.assign(file.begin() + static_cast<std::ptrdiff_t>(tail_at_), file.end());
}

bool Ending::put(const Image& image, std::size_t strip_end, Bytes& file) const {
  if (tail_.empty() || !(image == image_)) return false;
  const std::size_t begin = even(strip_end);
  file.resize(begin + tail_.size());
  if (begin != strip_end) file[strip_end] = std::byte{0};
  std::byte* const tail = file.data() + begin;
  std::memcpy(file.data(), head_.data(), head_.size());
  std::memcpy(tail, tail_.data(), tail_.size());
  const auto moved = [&](std::byte* bytes, std::size_t at) {
    std::uint32_t offset = 0;
    std::memcpy(&offset, bytes + at, sizeof offset);
    put_at(bytes, at, static_cast<std::uint32_t>(offset - tail_at_ + begin));
  };
  moved(file.data(), kDirectoryAt);
  for (const std::size_t place : places_) moved(tail, place);
  const std::size_t length = strip_end - kStripAt;
  if (short_length_) {
    put_at(tail, length_at_, static_cast<std::uint16_t>(length));
  } else {
    put_at(tail, length_at_, static_cast<std::uint32_t>(length));
  }
  return true;
}

}  // namespace lamina::write::tiff
