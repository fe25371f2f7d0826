// stages/formats/png/chunk.h: the frame of a chunk: length, name, content, check (PNG specification, section 5.3).
#pragma once

#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace lamina::formats::png {

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

}  // namespace lamina::formats::png
