// stages/formats/tiff/memory_file.h: a file in memory that libtiff writes to.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "stages/data/buffer.h"
#include "stages/support/late/tiff.h"

namespace lamina::write::tiff {

/// Content is bytes[0 .. size); the buffer may be larger, so that it need not grow with every write.
struct MemoryFile {
  Buffer<std::byte>& bytes;
  std::uint64_t size = 0;
  std::uint64_t position = 0;
};

/// Largest size of a file whose offsets have 32 bits.
inline constexpr std::uint64_t kMostClassicBytes = 0xFFFFFFFF;

/// A little-endian classic TIFF to be written into `file`, which must outlive the handle, as must `message`: libtiff's
/// own words on the first thing that goes wrong. nullptr if memory ran out.
TiffHandle open_for_writing(MemoryFile& file, std::string& message);

}  // namespace lamina::write::tiff
