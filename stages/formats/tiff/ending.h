// stages/formats/tiff/ending.h: what stands behind the only strip of a classic TIFF, kept from one layer to the next.
//
// libtiff sorts its table of fields for every file that it opens: some 60 us, which is what a small layer takes to be encoded.
// Layers of a job differ in their strip alone, so libtiff writes the directory of the first one, and those of others are
// copies, moved behind their strips, with the strip's length put in. Layout: TIFF 6.0 (Adobe 1992), section 2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/formats/image_format.h"

namespace lamina::write::tiff {

class Ending {
 public:
  /// What decides the directory, but for the length of the strip: lengths of 16 and of 32 bits are different fields.
  struct Image {
    std::uint32_t columns = 0, rows = 0;
    double dpi_x = 0, dpi_y = 0;
    bool long_strip = false;
    bool operator==(const Image&) const = default;
  };

  /// Keeps the ending of a whole file, as libtiff wrote it, whose strip ends at `strip_end`. Keeps nothing of a file that is
  /// laid out otherwise than in one strip from byte 8 on and all else behind it.
  void take(const Image& image, std::span<const std::byte> file, std::size_t strip_end);
  /// Ends another file, whose strip stands from byte 8 to `strip_end`. returns  false if no ending of such an image is kept
  bool put(const Image& image, std::size_t strip_end, Bytes& file) const;

 private:
  bool find_fields(std::span<const std::byte> file, std::size_t strip_end);

  Image image_;
  std::vector<std::byte> head_, tail_;  // before and behind the strip
  std::vector<std::size_t> places_;     // in tail_, of 32-bit offsets into the file
  std::size_t tail_at_ = 0;             // where it stood
  std::size_t length_at_ = 0;           // in tail_, of the strip's length
  bool short_length_ = false;           // of 16 bits
};

}  // namespace lamina::write::tiff
