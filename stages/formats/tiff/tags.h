// stages/formats/tiff/tags.h: what all TIFF files of layers have in common (README.md in this folder).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/formats/image_format.h"
#include "stages/support/late/tiff.h"

namespace lamina::formats::tiff {

/// Content is bytes[0 .. size); the buffer may be larger, so that it need not grow with every write.
struct MemoryFile {
  Buffer<std::byte>& bytes;
  std::uint64_t size = 0;
  std::uint64_t position = 0;
};

/// Largest size of a file whose offsets have 32 bits.
inline constexpr std::uint64_t kMaxClassicBytes = 0xFFFFFFFF;

/// A little-endian classic TIFF to be written into `file`, which must outlive the handle, as must `message`: libtiff's
/// own words on the first thing that goes wrong. nullptr if memory ran out.
TiffHandle open_for_writing(MemoryFile& file, std::string& message);

/// A strip of bits is at most this long, unless a row is longer: it stays in the second-level cache between being
/// filled and being read, and a reader needs no more memory than that.
inline constexpr std::size_t kStripBytes = 256 * 1024;
/// Room for the directory and what it points to, so that libtiff's last writes do not grow the buffer.
inline constexpr std::size_t kDirectoryBytes = 1024;

struct TagFrame {
  std::uint32_t columns = 0, rows = 0;
  double dpi_x = 0, dpi_y = 0;
};

Error cannot_hold(std::uint32_t columns, std::uint32_t rows, std::string_view why);
Status check_size(std::uint32_t columns, std::uint32_t rows);

/// Min-is-white, one sample of so many bits.
void set_tags(TIFF* tiff, const TagFrame& frame, std::uint16_t bits, std::uint16_t compression, std::uint32_t rows_per_strip);

/// Writes the directory; after this the file is whole or the error says why not.
Status finish(TiffHandle tiff, bool strips_written, MemoryFile& memory, const TagFrame& frame, const std::string& message);

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

// --- what stands behind the only strip of a classic TIFF, kept from one layer to the next.
//
// libtiff sorts its table of fields for every file that it opens: some 60 us, which is what a small layer takes to be encoded.
// Layers of a job differ in their strip alone, so libtiff writes the directory of the first one, and those of others are
// copies, moved behind their strips, with the strip's length put in. Layout: TIFF 6.0 (Adobe 1992), section 2.

class Ending {
 public:
  /// What decides the directory, but for the length of the strip: lengths of 16 and of 32 bits are different fields.
  struct TiffLayout {
    std::uint32_t columns = 0, rows = 0;
    double dpi_x = 0, dpi_y = 0;
    bool long_strip = false;
    bool operator==(const TiffLayout&) const = default;
  };

  /// Keeps the ending of a whole file, as libtiff wrote it, whose strip ends at `strip_end`. Keeps nothing of a file with
  /// another layout than one strip from byte 8 on and all else after it.
  void take(const TiffLayout& image, std::span<const std::byte> file, std::size_t strip_end);
  /// Ends another file, whose strip stands from byte 8 to `strip_end`. returns  false if no ending of such an image is kept
  bool put(const TiffLayout& image, std::size_t strip_end, Bytes& file) const;

 private:
  bool find_fields(std::span<const std::byte> file, std::size_t strip_end);

  TiffLayout image_;
  std::vector<std::byte> head_, tail_;  // before and behind the strip
  std::vector<std::size_t> offsets_;    // in tail_, of 32-bit offsets into the file
  std::size_t tail_at_ = 0;             // where it stood
  std::size_t length_at_ = 0;           // in tail_, of the strip's length
  bool short_length_ = false;           // of 16 bits
};

}  // namespace lamina::formats::tiff
