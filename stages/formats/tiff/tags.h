// stages/formats/tiff/tags.h: what all TIFF files of layers have in common (README.md beside this file).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "stages/data/status.h"
#include "stages/formats/image_format.h"
#include "stages/formats/tiff/memory_file.h"

namespace lamina::write::tiff {

/// A strip of bits is at most this long, unless a row is longer: it stays in the second-level cache between being
/// filled and being read, and a reader needs no more memory than that.
inline constexpr std::size_t kStripBytes = 256 * 1024;
/// Room for the directory and what it points to, so that libtiff's last writes do not grow the buffer.
inline constexpr std::size_t kDirectoryBytes = 1024;

struct Frame {
  std::uint32_t columns = 0, rows = 0;
  double dpi_x = 0, dpi_y = 0;
};

Error cannot_hold(std::uint32_t columns, std::uint32_t rows, std::string_view why);
Status check_size(std::uint32_t columns, std::uint32_t rows);

/// Min-is-white, one sample of so many bits.
void set_tags(TIFF* tiff, const Frame& frame, std::uint16_t bits, std::uint16_t compression, std::uint32_t rows_per_strip);

/// Writes the directory; after this the file is whole or the error says why not.
Status finish(TiffHandle tiff, bool strips_written, MemoryFile& memory, const Frame& frame, const std::string& message);

/// Keeps what files say of their layers, without an allocation a layer.
class LayerText {
 public:
  void take(const LayerTags& tags);
  /// Whether there is something to be said.
  bool any() const { return pages_ != 0; }
  void put(TIFF* tiff) const;

 private:
  char text_[256] = "";
  std::uint32_t page_ = 0, pages_ = 0;
};

}  // namespace lamina::write::tiff
