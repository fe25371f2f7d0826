#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "stages/data/units.h"
#include "stages/formats/g4/encode.h"
#include "stages/formats/tiff/ending.h"
#include "stages/formats/tiff/memory_file.h"
#include "stages/formats/tiff/tags.h"
#include "stages/formats/tiff/tiff.h"
#include "stages/geometry/bits.h"

namespace lamina::write::tiff {
namespace {

// libtiff's header of a classic TIFF. The first strip follows it.
constexpr std::size_t kHeaderBytes = 8;

class G4Encoder : public ImageEncoder {
 public:
  void tag(const LayerTags& tags) override { text_.take(tags); }
  void use(Isa isa) override { encoder_ = g4::Encoder(isa); }

  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size(runs.columns, runs.rows()); !status) return status;
    file.resize(file.capacity());
    const std::size_t end = encoder_.encode(runs, file, kHeaderBytes);
    if (end > kMostClassicBytes - kDirectoryBytes) return cannot_hold(runs.columns, runs.rows(), "the file would exceed 4 GiB");
    const Ending::Image image{runs.columns, runs.rows(), dpi_x, dpi_y, end - kHeaderBytes > UINT16_MAX};
    if (!text_.any() && ending_.put(image, end, file)) return {};
    if (file.size() < end + kDirectoryBytes) file.resize(end + kDirectoryBytes);

    MemoryFile memory{file};
    std::string message;
    TiffHandle tiff = open_for_writing(memory, message);
    if (tiff == nullptr) return cannot_hold(runs.columns, runs.rows(), message);
    set_tags(tiff.get(), {runs.columns, runs.rows(), dpi_x, dpi_y}, 1, COMPRESSION_CCITTFAX4, runs.rows());
    text_.put(tiff.get());
    const auto length = static_cast<tmsize_t>(end - kHeaderBytes);
    const bool written = TIFFWriteRawStrip(tiff.get(), 0, file.data() + kHeaderBytes, length) == length;
    Status status = finish(std::move(tiff), written, memory, {runs.columns, runs.rows(), dpi_x, dpi_y}, message);
    if (status && !text_.any()) ending_.take(image, file, end);
    return status;
  }

 private:
  LayerText text_;
  g4::Encoder encoder_;
  Ending ending_;  // of the layer before
};

class StripEncoder : public ImageEncoder {
 public:
  void tag(const LayerTags& tags) override { text_.take(tags); }
  explicit StripEncoder(std::uint16_t compression) : compression_(compression) {}

  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    if (Status status = check_size(runs.columns, runs.rows()); !status) return status;
    const std::size_t stride = row_bytes(runs.columns);
    if (compression_ == COMPRESSION_NONE && stride * runs.rows() > kMostClassicBytes - kStripBytes) {
      return cannot_hold(runs.columns, runs.rows(), "the file would exceed 4 GiB; use --format tiff-g4");
    }
    const auto rows_per_strip = static_cast<std::uint32_t>(std::clamp<std::size_t>(kStripBytes / stride, 1, runs.rows()));
    if (compression_ == COMPRESSION_NONE) {  // its size is known: nothing has to grow, and no second copy exists meanwhile
      const std::size_t strips = ceil_div<std::size_t>(runs.rows(), rows_per_strip);
      file.clear();
      file.reserve(kHeaderBytes + stride * runs.rows() + kDirectoryBytes + strips * 2 * sizeof(std::uint32_t));
    }
    file.resize(file.capacity());
    MemoryFile memory{file};
    std::string message;
    TiffHandle tiff = open_for_writing(memory, message);
    if (tiff == nullptr) return cannot_hold(runs.columns, runs.rows(), message);
    set_tags(tiff.get(), {runs.columns, runs.rows(), dpi_x, dpi_y}, 1, compression_, rows_per_strip);
    text_.put(tiff.get());

    bool written = true;
    bits_.resize(stride * rows_per_strip);
    for (std::uint32_t first = 0, strip = 0; first < runs.rows() && written; first += rows_per_strip, ++strip) {
      const std::uint32_t rows = std::min(rows_per_strip, runs.rows() - first);
      for (std::uint32_t r = 0; r < rows; ++r) {
        expand_row(runs.row(first + r), std::span(bits_).subspan(stride * r, stride));
      }
      const auto length = static_cast<tmsize_t>(stride * rows);
      written = compression_ == COMPRESSION_NONE ? TIFFWriteRawStrip(tiff.get(), strip, bits_.data(), length) == length
                                                 : TIFFWriteEncodedStrip(tiff.get(), strip, bits_.data(), length) == length;
    }
    return finish(std::move(tiff), written, memory, {runs.columns, runs.rows(), dpi_x, dpi_y}, message);
  }

 private:
  LayerText text_;
  std::uint16_t compression_;
  Bytes bits_;  // of one strip
};

}  // namespace

std::unique_ptr<ImageEncoder> make_g4_encoder() { return std::make_unique<G4Encoder>(); }
std::unique_ptr<ImageEncoder> make_packbits_encoder() { return std::make_unique<StripEncoder>(COMPRESSION_PACKBITS); }
std::unique_ptr<ImageEncoder> make_uncompressed_encoder() { return std::make_unique<StripEncoder>(COMPRESSION_NONE); }

}  // namespace lamina::write::tiff
