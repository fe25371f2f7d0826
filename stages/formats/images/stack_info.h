// stages/formats/images/stack_info.h: what there is to say about layer images before they are planned.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/support/text/json_value.h"

namespace lamina::formats {

/// How an image is stored, in words for people.
struct ImageKind {
  std::string format;  // TIFF, PNG, BMP, PBM, PGM
  std::uint32_t bits = 1;
  std::string light;   // what 0 means: "0 is white", "0 is black", "by its palette"
  std::string coding;  // Group 4, PackBits, deflate, none, ...
  bool operator==(const ImageKind&) const = default;
};

/// page  of pages_of(). errors  kInput: not readable
Result<ImageKind> kind_of(const std::string& path, std::uint64_t page = 0);

struct StackInfo {
  std::string path;  // of the images
  bool folder = false;
  std::uint64_t files = 0, images = 0;                // images: pages of all files
  std::uint64_t first_number = 0, last_number = 0;    // in the names of a folder's files
  std::vector<std::array<std::uint64_t, 2>> missing;  // ranges of numbers, both ends included
  ImageKind kind;                                     // of the first image, as the next ones
  std::uint32_t columns = 0, rows = 0;
  double dpi_x = 0, dpi_y = 0;                      // 0: not stated
  std::uint64_t set = 0, min_set = 0, max_set = 0;  // dark pixels, of all images and of one
  std::uint64_t empty = 0;                          // images without any
  std::uint64_t grey = 0;                           // pixels between white and black
  double filled = 0;                                // pixels, each by its darkness
  std::uint64_t unreadable = 0, differing = 0;      // images; those that no job takes as they are
  std::vector<std::string> wrong;                   // the first of them, a line each

  std::uint64_t missing_numbers() const;
};

/// Reads all images of a folder or a file, side by side, rows of each in memory.
/// threshold  1 .. 255: grey below it is dark
/// memory     bytes that those being read may take
/// errors     kInput: no images, two of one number, no number in a name; the first image cannot be read
Result<StackInfo> inspect_stack(const std::string& path, int threshold, std::uint64_t memory = std::uint64_t{1} << 30);

std::string as_text(const StackInfo& info);
Json as_json(const StackInfo& info);

}  // namespace lamina::formats
