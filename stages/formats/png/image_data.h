// stages/formats/png/image_data.h: chunks, and the image data of a 1-bit PNG straight from runs: no row of bits, no byte of
// white.
#pragma once

#include <zlib.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "stages/formats/image_format.h"
#include "stages/formats/png/deflate.h"
#include "stages/geometry/bits.h"

namespace lamina::formats::png {

/// The frame of a chunk: length, name, content, check (PNG specification, section 5.3).
inline constexpr std::size_t kChunkHead = 8, kChunkTail = 4;  // bytes before and behind the content

inline std::byte* put_number(std::byte* at, std::uint32_t number) {
  for (int shift = 24; shift >= 0; shift -= 8) *at++ = static_cast<std::byte>(number >> shift);
  return at;
}

/// Frames what stands from `chunk` + kChunkHead to `end`; there is room for kChunkTail bytes. returns  the end of the chunk
inline std::byte* close_chunk(std::byte* chunk, std::byte* end, std::string_view name) {
  const auto length = static_cast<std::uint32_t>(end - chunk - std::ptrdiff_t{kChunkHead});
  put_number(chunk, length);
  std::memcpy(chunk + 4, name.data(), 4);
  const auto check = ::crc32(0, reinterpret_cast<const Bytef*>(chunk + 4), length + 4);
  return put_number(end, static_cast<std::uint32_t>(check));
}

/// zlib's header (RFC 1950, 2.2), 16 bits: deflate, a window of 32 KiB, no dictionary, the fastest level.
inline constexpr std::uint32_t kZlibHeader = 0x0178;

/// A chunk is closed at the first row's end from here on.
inline constexpr std::size_t kChunkBytes = 64 * 1024;

/// The memory into which chunks of image data are written; chunks end by the bytes written alone.
class Chunks {
 public:
  Chunks(Bytes& file, std::size_t start) : file_(file), chunk_(start) {
    const std::size_t minimum = start + kChunkHead + 4096;
    if (file_.size() < minimum) file_.resize(std::max(minimum, file_.capacity()));
    limit_ = limit();
  }

  std::byte* content() { return file_.data() + chunk_ + kChunkHead; }

  /// Closes a chunk that is long enough and makes room for `bytes` more.
  void ensure_capacity(BitWriter& out, std::size_t bytes) {
    if (out.next() + bytes > limit_) [[unlikely]]
      out = reserve_bytes(out, bytes);
  }

  std::size_t close(std::byte* end) {
    return static_cast<std::size_t>(close_chunk(file_.data() + chunk_, end, "IDAT") - file_.data());
  }

 private:
  [[gnu::noinline]] BitWriter reserve_bytes(BitWriter out, std::size_t bytes) {
    std::size_t used = static_cast<std::size_t>(out.next() - file_.data());
    if (used - chunk_ >= kChunkBytes) {
      grow(used, kChunkTail + kChunkHead + bytes);
      used = static_cast<std::size_t>(close_chunk(file_.data() + chunk_, file_.data() + used, "IDAT") - file_.data());
      chunk_ = used;
      used += kChunkHead;
    }
    grow(used, bytes);
    out.move_to(file_.data() + used);
    limit_ = limit();
    return out;
  }
  void grow(std::size_t used, std::size_t bytes) {
    bytes += kSlack;
    if (file_.size() - used < bytes) file_.resize(std::max(used + bytes, file_.size() * 2));
  }
  /// Where writing stops to think: at the end of the memory, or where the chunk is long enough.
  std::byte* limit() const { return file_.data() + std::min(file_.size() - kSlack, chunk_ + kChunkHead + kChunkBytes); }

  static constexpr std::size_t kSlack = 64;  // a store beyond the last byte, the stream's check, the chunk's

  Bytes& file_;
  std::size_t chunk_;
  std::byte* limit_;
};

/// Rows of bits, filtered and deflated, as IDAT chunks into file[start ...). Bytes before `start` are kept; the file grows
/// as needed and may be left larger than its content.
/// changes  of all rows
/// needs    1 <= columns and rows <= kMaxPixelsASide and well-formed runs (data/runs.h)
/// returns  one past the last byte of the chunks
/// cost     one read of each change and some 5 ns for each that is not as in the row above; some 10 ns for a row that is not
///          white; a stretch of white rows costs the logarithm of its length and a bit in a hundred bytes
std::size_t put_image_data(RowRuns& image, std::uint64_t changes, Bytes& file, std::size_t start);

}  // namespace lamina::formats::png
