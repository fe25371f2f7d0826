#include "stages/formats/tiff/memory_file.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <new>

namespace lamina::write::tiff {
namespace {

MemoryFile& file_of(thandle_t handle) { return *static_cast<MemoryFile*>(handle); }

tmsize_t read_nothing(thandle_t, void*, tmsize_t) { return 0; }

tmsize_t write_bytes(thandle_t handle, void* from, tmsize_t count) {
  MemoryFile& file = file_of(handle);
  const std::uint64_t end = file.position + static_cast<std::uint64_t>(count);
  if (end > kMostClassicBytes) return 0;
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

}  // namespace lamina::write::tiff
