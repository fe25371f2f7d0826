// stages/write/tiff/memory_file.h: a file in memory that libtiff writes to.
#pragma once

#include <tiffio.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "stages/data/buffer.h"

namespace lamina::write::tiff {

/// Content is bytes[0 .. size); the buffer may be larger, so that it need not grow with every write.
struct MemoryFile {
  Buffer<std::byte>& bytes;
  std::uint64_t size = 0;
  std::uint64_t position = 0;
};

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using TiffHandle = std::unique_ptr<TIFF, CloseTiff>;

/// Largest size of a file whose offsets have 32 bits.
inline constexpr std::uint64_t kMostClassicBytes = 0xFFFFFFFF;

/// A little-endian classic TIFF to be written into `file`, which must outlive the handle, as must `message`: libtiff's
/// own words on the first thing that goes wrong. nullptr if memory ran out.
TiffHandle open_for_writing(MemoryFile& file, std::string& message);

struct FreeOptions {
  void operator()(TIFFOpenOptions* options) const { TIFFOpenOptionsFree(options); }
};
using OptionsHandle = std::unique_ptr<TIFFOpenOptions, FreeOptions>;

/// For TIFFOpen and its kin: the first error goes into `message` instead of to the terminal. So does the first warning,
/// because libtiff only warns of a tag cut off and of G4 rows of wrong length; tags that it does not know are fine.
OptionsHandle strict_options(std::string& message);

}  // namespace lamina::write::tiff
