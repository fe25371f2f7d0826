// stages/formats/images/layer_images.h: numbered layer images, and a stack of them of which one layer is read at a time.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/bits.h"

namespace lamina::formats {

/// Whether a name is that of layer images: a folder, or a file that ends in .tif, .tiff, .png, .bmp, .pbm or .pgm.
bool names_images(const std::string& path);

struct Numbered {
  std::uint64_t number;
  std::string path;
};

/// Images .png, .tif, .tiff, .bmp, .pbm, .pgm of a folder in the order of the last numbers in their names, or of heights with
/// decimal points (sort_images()); at least one.
/// Hidden files, folders and files of other kinds are passed over.
/// gaps    numbers may be missing
/// errors  kInput: no such images, no number in a name, two of one number or of two orders, a number missing, a numbered JPEG,
/// GIF or the like
Result<std::vector<Numbered>> numbered_images(const std::string& folder, bool gaps = false);

/// Facts that the files do not state.
struct LayerImagesRequest {
  int threshold = 128;            // 1 .. 255: grey below it is set
  bool invert = false;            // bright pixels are set
  bool missing_empty = false;     // missing numbers are empty layers
  std::uint32_t inspections = 1;  // images that are decoded at first, spread over the stack, for expected_changes()
};

/// Images of one size and one resolution; const, readable from any thread.
class LayerImages {
 public:
  /// A folder of numbered images of one page, or one file of one page or several. Reads all bytes once, for their hash, and
  /// decodes the first image, and as many others as requested.
  /// errors  kInput: those of numbered_images() and dark_pixels()
  static Result<LayerImages> open(const std::string& path, const LayerImagesRequest& request);

  std::uint32_t columns() const { return columns_; }
  std::uint32_t rows() const { return rows_; }
  std::uint32_t layers() const { return static_cast<std::uint32_t>(pages_.size()); }
  std::uint32_t missing() const { return missing_; }  // layers that are empty because their numbers are missing
  double dpi_x() const { return dpi_x_; }             // 0 where the files do not say
  double dpi_y() const { return dpi_y_; }
  std::uint64_t fingerprint() const { return fingerprint_; }  // of all files' bytes and of the request
  std::uint64_t first_number() const { return first_number_; }
  /// Of the file of a layer; empty for a layer that is missing.
  std::string_view file(std::uint32_t layer) const;
  /// An estimate of a layer's changes, rather too high: the size of its file times twice the changes a byte of the densest
  /// inspected one.
  std::uint64_t expected_changes(std::uint32_t layer) const;

  /// The memory that such runs take at most, or the bits of an image with more.
  std::uint64_t expected_bytes(std::uint32_t layer) const;
  std::uint64_t file_bytes(std::uint32_t layer) const { return pages_[layer].bytes; }  // its share of the file

  /// Decodes one layer. errors  kInput with the file: cannot be read, is of another size or resolution than the first,
  /// or was changed since open()
  Result<Runs> read(std::uint32_t layer) const;
  /// The same as runs or bits. keep  kRuns or kSmaller
  Result<Image> read(std::uint32_t layer, Keep keep) const;
  /// The same in levels up to `full`, 1 to 255, regardless of the threshold: nearest_levels().
  Result<Levels> levels(std::uint32_t layer, std::uint8_t full) const;
  /// The same; of an image of 1 bit whose levels would take more memory, the bits of the image returned instead.
  Result<Image> levels(std::uint32_t layer, std::uint8_t full, Levels& levels, Keep keep) const;

 private:
  struct Page {
    std::uint32_t file = UINT32_MAX;  // of files_; UINT32_MAX: missing
    std::uint64_t position = 0;       // of pages_of()
    std::uint64_t bytes = 0;          // its share of the file
  };
  /// Detects that a file has changed since it was hashed.
  struct Stamp {
    std::uint64_t bytes = 0;
    std::int64_t modified = 0;  // of the clock of files
    bool operator==(const Stamp&) const = default;
  };
  static Stamp stamp_of(const std::string& path);
  /// errors  kInput: the file is another one than at open(), or the image differs from the first
  Status check(std::uint32_t layer, const Image& image, std::uint32_t columns, std::uint32_t rows) const;
  Status check_stamp(std::uint32_t file) const;
  Status inspect_others(std::uint64_t changes_of_first);

  std::vector<std::string> files_;
  std::vector<Stamp> stamps_;  // of each of them
  std::vector<Page> pages_;
  LayerImagesRequest request_;
  std::uint32_t columns_ = 0, rows_ = 0, missing_ = 0;
  double dpi_x_ = 0, dpi_y_ = 0;
  std::uint64_t fingerprint_ = 0, first_number_ = 0;
  double changes_a_byte_ = 0;  // maximum of the inspected ones
};

}  // namespace lamina::formats
