#include "stages/formats/png/coloured.h"

#include <zlib.h>

#include <cstdlib>
#include <string_view>

#include "stages/formats/png/chunk.h"

namespace lamina::formats::png {
namespace {

void add_chunk(Buffer<std::byte>& file, std::string_view name, std::span<const std::byte> content) {
  const std::size_t begin = file.size();
  file.resize(begin + kChunkHead);
  file.insert(file.end(), content.begin(), content.end());
  file.resize(file.size() + kChunkTail);
  close_chunk(file.data() + begin, file.data() + file.size() - kChunkTail, name);
}

}  // namespace

Buffer<std::byte> coloured(std::uint32_t columns, std::span<const std::string> colours, std::span<const std::uint8_t> pixels) {
  const auto rows = static_cast<std::uint32_t>(pixels.size() / columns);
  Buffer<std::byte> file, part(13, std::byte{});
  for (const int byte : {0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A}) file.push_back(static_cast<std::byte>(byte));
  put_number(put_number(part.data(), columns), rows);
  part[8] = std::byte{8};  // bits a pixel
  part[9] = std::byte{3};  // numbers of a palette
  add_chunk(file, "IHDR", part);
  part.clear();
  for (const std::string& colour : colours) {
    const unsigned long rgb = std::strtoul(colour.c_str(), nullptr, 16);
    for (const int shift : {16, 8, 0}) part.push_back(static_cast<std::byte>(rgb >> shift));
  }
  add_chunk(file, "PLTE", part);
  Buffer<std::byte> plain;
  for (std::uint32_t r = 0; r < rows; ++r) {
    plain.push_back(std::byte{0});
    const auto row = std::as_bytes(pixels.subspan(std::size_t{columns} * r, columns));
    plain.insert(plain.end(), row.begin(), row.end());
  }
  uLongf size = ::compressBound(plain.size());
  part.resize(size);
  ::compress2(reinterpret_cast<Bytef*>(part.data()), &size, reinterpret_cast<const Bytef*>(plain.data()), plain.size(), 9);
  part.resize(size);
  add_chunk(file, "IDAT", part);
  add_chunk(file, "IEND", {});
  return file;
}

}  // namespace lamina::formats::png
