#include "stages/formats/tiff/tags.h"

#include <fmt/format.h>
#include <tiff.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <new>

#include "stages/geometry/bits.h"
#include "stages/support/text/decimal.h"

namespace lamina::formats::tiff {
namespace {

MemoryFile& file_of(thandle_t handle) { return *static_cast<MemoryFile*>(handle); }

tmsize_t read_nothing(thandle_t, void*, tmsize_t) { return 0; }

tmsize_t write_bytes(thandle_t handle, void* from, tmsize_t count) {
  MemoryFile& file = file_of(handle);
  const std::uint64_t end = file.position + static_cast<std::uint64_t>(count);
  if (end > kMaxClassicBytes) return 0;
  std::byte* to = file.bytes.data() + file.position;
  // Strips that were encoded in the place where libtiff puts them are there already.
  const bool in_place = from == to && end <= file.bytes.size();
  if (!in_place) {
    if (end > file.bytes.size()) {
      try {
        file.bytes.resize(std::max<std::size_t>({end, file.bytes.size() * 2, std::size_t{4096}}));
      } catch (const std::bad_alloc&) {
        return 0;
      }
      to = file.bytes.data() + file.position;
    }
    std::memcpy(to, from, static_cast<std::size_t>(count));
  }
  // libtiff begins its directory at an even offset and skips a byte for that; in a buffer used before, that byte is
  // one of an older image.
  if (file.position > file.size) std::memset(file.bytes.data() + file.size, 0, file.position - file.size);
  file.position = end;
  file.size = std::max(file.size, end);
  return count;
}

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  MemoryFile& file = file_of(handle);
  const std::uint64_t base = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? file.position : file.size;
  file.position = base + offset;
  return file.position;
}

int close_nothing(thandle_t) { return 0; }

toff_t size_of(thandle_t handle) { return file_of(handle).size; }

}  // namespace

TiffHandle open_for_writing(MemoryFile& file, std::string& message) {
  const auto options = strict_tiff_options(message);
  if (options == nullptr) return nullptr;
  return TiffHandle(TIFFClientOpenExt("layer", "wl", &file, read_nothing, write_bytes, seek, close_nothing, size_of, nullptr,
                                      nullptr, options.get()));
}

Error cannot_hold(std::uint32_t columns, std::uint32_t rows, std::string_view why) {
  return {Fault::kOutput, fmt::format("TIFF cannot hold a layer of {} x {} pixels: {}", columns, rows, why)};
}

Status check_size(std::uint32_t columns, std::uint32_t rows) {
  if (columns == 0 || rows == 0) return cannot_hold(columns, rows, "it has no pixels");
  if (columns > kMaxPixelsASide || rows > kMaxPixelsASide) {
    return cannot_hold(columns, rows, fmt::format("a side has at most {} pixels", kMaxPixelsASide));
  }
  return {};
}

void set_tags(TIFF* tiff, const TagFrame& frame, std::uint16_t bits, std::uint16_t compression, std::uint32_t rows_per_strip) {
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, frame.columns);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, frame.rows);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, static_cast<int>(bits));
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, static_cast<int>(compression));
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE);
  TIFFSetField(tiff, TIFFTAG_FILLORDER, FILLORDER_MSB2LSB);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, rows_per_strip);
  TIFFSetField(tiff, TIFFTAG_XRESOLUTION, frame.dpi_x);
  TIFFSetField(tiff, TIFFTAG_YRESOLUTION, frame.dpi_y);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_RESOLUTIONUNIT, RESUNIT_INCH);
  TIFFSetField(tiff, TIFFTAG_SOFTWARE, "lamina");  // without a version: releases do not change the bytes of layers
}

Status finish(TiffHandle tiff, bool strips_written, MemoryFile& memory, const TagFrame& frame, const std::string& message) {
  const bool directory_written = strips_written && TIFFFlush(tiff.get()) != 0;
  tiff.reset();
  if (!directory_written) {
    if (memory.position > kMaxClassicBytes - kStripBytes - kDirectoryBytes) {
      return cannot_hold(frame.columns, frame.rows, "the file would exceed 4 GiB; use --format tiff-g4");
    }
    return cannot_hold(frame.columns, frame.rows, message.empty() ? "out of memory" : message);
  }
  memory.bytes.resize(memory.size);
  return {};
}

void LayerText::take(const LayerTags& tags) {
  constexpr std::size_t kLongestTitle = 128;
  char bottom[kMaxDecimal], top[kMaxDecimal];
  *put_mm(tags.bottom, bottom) = *put_mm(tags.top, top) = 0;
  const std::string_view title = std::string_view(tags.title).substr(0, kLongestTitle);
  const auto put =
      fmt::format_to_n(text_, sizeof text_ - 1, "{}{}layer {} of {}, z {} to {} mm{}{}{}{}", title, title.empty() ? "" : ", ",
                       tags.layer + 1, tags.layers, bottom, top, tags.material.empty() ? "" : ", ", tags.material,
                       tags.mirror.empty() ? "" : ", mirrored in ", tags.mirror);
  for (char* c = text_; c != put.out; ++c) *c = *c >= ' ' && *c <= '~' ? *c : '?';  // 7-bit ASCII, TIFF 6.0 section 2
  *put.out = 0;
  page_ = tags.layer;
  pages_ = tags.layers;
}

void LayerText::put(TIFF* tiff) const {
  if (pages_ == 0) return;
  TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, text_);
  if (pages_ <= UINT16_MAX) TIFFSetField(tiff, TIFFTAG_PAGENUMBER, static_cast<int>(page_), static_cast<int>(pages_));
}

namespace {

constexpr std::size_t kStripAt = 8, kDirectoryAt = 4, kEntryBytes = 12, kMaxTail = 1024;

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
  if (file.size() < tail_at_ + 2 || file.size() > tail_at_ + kMaxTail) return false;
  const std::size_t directory = number_at<std::uint32_t>(file, kDirectoryAt);
  if (directory < tail_at_ || directory + 2 > file.size()) return false;
  const std::size_t entries = number_at<std::uint16_t>(file, directory);
  if (directory + 2 + entries * kEntryBytes > file.size()) return false;
  offsets_.clear();
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
      offsets_.push_back(value - tail_at_);
    }
    if ((tag == TIFFTAG_STRIPBYTECOUNTS || tag == TIFFTAG_STRIPOFFSETS) && bytes > 4) return false;
  }
  return length_at_ != 0;
}

void Ending::take(const TiffLayout& image, std::span<const std::byte> file, std::size_t strip_end) {
  tail_.clear();
  if (!find_fields(file, strip_end)) return;
  image_ = image;
  head_.assign(file.begin(), file.begin() + kStripAt);
  tail_.assign(file.begin() + static_cast<std::ptrdiff_t>(tail_at_), file.end());
}

bool Ending::put(const TiffLayout& image, std::size_t strip_end, Bytes& file) const {
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
  for (const std::size_t position : offsets_) moved(tail, position);
  const std::size_t length = strip_end - kStripAt;
  if (short_length_) {
    put_at(tail, length_at_, static_cast<std::uint16_t>(length));
  } else {
    put_at(tail, length_at_, static_cast<std::uint32_t>(length));
  }
  return true;
}

}  // namespace lamina::formats::tiff
