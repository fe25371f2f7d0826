#include "stages/formats/zip/deflate.h"

#include <zlib.h>

#include <algorithm>
#include <memory>

namespace lamina::write {

Status deflate_onto(Deflated& out, std::string_view text) {
  if (text.empty()) return {};
  const Error no_memory{Fault::kOutput, "no memory is left to compress a package"};
  z_stream stream{};
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) != Z_OK) return no_memory;
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, deflateEnd);
  Buffer<std::byte> room(std::size_t{64} << 10);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t count = std::min(text.size() - at, std::size_t{1} << 30);
    auto* const input = reinterpret_cast<const Bytef*>(text.data() + at);
    out.crc = static_cast<std::uint32_t>(crc32(out.crc, input, static_cast<uInt>(count)));
    stream.next_in = const_cast<Bytef*>(input);
    stream.avail_in = static_cast<uInt>(count);
    at += count;
    do {
      stream.next_out = reinterpret_cast<Bytef*>(room.data());
      stream.avail_out = static_cast<uInt>(room.size());
      if (deflate(&stream, at == text.size() ? Z_FULL_FLUSH : Z_NO_FLUSH) == Z_STREAM_ERROR) return no_memory;
      out.bytes.insert(out.bytes.end(), room.begin(), room.end() - stream.avail_out);
    } while (stream.avail_out == 0);
  }
  out.size += text.size();
  return {};
}

}  // namespace lamina::write
