// TIFF of 4 or 8 bits a pixel, min-is-white: the darkest value is a full voxel. TIFF 6.0, sections 4 and 9.
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "stages/data/units.h"
#include "stages/formats/level_format.h"
#include "stages/formats/tiff/tags.h"
#include "stages/formats/tiff/tiff.h"

namespace lamina::write::tiff {
namespace {

class GreyEncoder : public LevelEncoder {
 public:
  explicit GreyEncoder(unsigned bits) : bits_(bits), darkest_((1u << bits) - 1) {}
  void tag(const LayerTags& tags) override { text_.take(tags); }

  Status encode(const LevelsView& image, std::uint8_t full, double dpi_x, double dpi_y, Bytes& file) override {
    const Frame frame{image.columns, image.rows(), dpi_x, dpi_y};
    if (Status status = check_size(frame.columns, frame.rows); !status) return status;
    if (full == 0 || darkest_ % full != 0) {
      return cannot_hold(frame.columns, frame.rows, fmt::format("{} levels are no whole steps of {} bits", full + 1, bits_));
    }
    const std::size_t stride = (std::size_t{image.columns} * bits_ + 7) / 8;
    const auto rows_per_strip = static_cast<std::uint32_t>(std::clamp<std::size_t>(kStripBytes / stride, 1, frame.rows));
    file.resize(file.capacity());
    MemoryFile memory{file};
    std::string message;
    TiffHandle tiff = open_for_writing(memory, message);
    if (tiff == nullptr) return cannot_hold(frame.columns, frame.rows, message);
    set_tags(tiff.get(), frame, static_cast<std::uint16_t>(bits_), COMPRESSION_PACKBITS, rows_per_strip);
    text_.put(tiff.get());
    bool written = true;
    strip_.resize(stride * rows_per_strip);
    for (std::uint32_t first = 0, strip = 0; first < frame.rows && written; first += rows_per_strip, ++strip) {
      const std::uint32_t rows = std::min(rows_per_strip, frame.rows - first);
      const std::size_t length = stride * rows;
      std::memset(strip_.data(), 0, length);
      for (std::uint32_t r = 0; r < rows; ++r) put_row(image, first + r, darkest_ / full, strip_.data() + stride * r);
      written = TIFFWriteEncodedStrip(tiff.get(), strip, strip_.data(), static_cast<tmsize_t>(length)) ==
                static_cast<tmsize_t>(length);
    }
    return finish(std::move(tiff), written, memory, frame, message);
  }

 private:
  /// The runs of a row over zeros. Of 4 bits the left pixel is in the high ones.
  void put_row(const LevelsView& image, std::uint32_t row, unsigned step, std::byte* to) const {
    for (std::uint32_t i = image.row_offset[row]; i < image.row_offset[row + 1]; ++i) {
      const unsigned value = image.level[i] * step;
      std::uint32_t begin = image.change[2 * i], end = image.change[2 * i + 1];
      if (bits_ == 8) {
        std::memset(to + begin, static_cast<int>(value), end - begin);
        continue;
      }
      if (begin % 2 != 0) to[begin++ / 2] |= static_cast<std::byte>(value);
      if (end > begin && end % 2 != 0) to[--end / 2] |= static_cast<std::byte>(value << 4);
      if (end > begin) std::memset(to + begin / 2, static_cast<int>(value * 17), (end - begin) / 2);
    }
  }

  LayerText text_;
  unsigned bits_, darkest_;
  Bytes strip_;
};

}  // namespace

std::unique_ptr<LevelEncoder> make_4_bit_encoder() { return std::make_unique<GreyEncoder>(4); }
std::unique_ptr<LevelEncoder> make_8_bit_encoder() { return std::make_unique<GreyEncoder>(8); }

}  // namespace lamina::write::tiff
