// stages/formats/images/image.h: layer images back into runs, through libtiff, libpng, and readers of Group 4 and PBM.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina {
class BitImage;
struct Levels;
}

namespace lamina::formats {

struct Image {
  Runs runs;
  double dpi_x = 0, dpi_y = 0;   // 0 where the file does not say
  std::string description = {};  // of a TIFF
  std::uint32_t columns = 0, rows = 0;
  std::shared_ptr<BitImage> bits = {};  // Keep::kSmaller: in place of runs that would take more memory
  PixelCounts counts = {};            // Keep::kCounts

  std::uint64_t set() const;
};

/// The dpi that a file's resolution stands for: whole ones where it counts whole pixels a metre, as PNG and BMP do, else as is.
double requested_dpi(double dpi);

/// Decodes a 1-bit image as the writers make them (TIFF of any 1-bit compression, PNG, PBM), row by row: memory is
/// the runs plus one row or strip of bits, or of Group 4 the coded strip.
/// full    of images that carry levels, that of a full voxel: their runs are as levels() gives them
/// keep    of images without levels
/// errors  kVerification with the file's name: truncated, not 1 bit, not readable
Result<Image> image(const std::string& path, std::uint8_t full = 0, Keep keep = Keep::kRuns);

/// The same of images of others: of 1 to 16 bits of grey, or of a palette (TIFF, PNG, BMP, PBM, PGM). Set are the pixels below
/// the threshold; transparent ones are white. threshold  1 .. 255 of 255; of 16 bits the upper eight count page       of
/// pages_of(); 0: the file has one image that is no thumbnail errors     kInput with the file's name: truncated, with other
/// colours, several images, not readable
Result<Image> dark_pixels(const std::string& path, int threshold, std::uint64_t page = 0, Keep keep = Keep::kRuns);

/// Decodes levels of voxels as the formats of stages/formats/image_format.h have them (TIFF of 4 or 8 bits, PNG of up to 8),
/// row by row. full    level of a full voxel: 1, 3 or 15 image   its runs are the pixels of any level above 0 levels  the
/// levels errors  kVerification with the file's name: of image(); a value that is not one of the levels
Result<Image> levels(const std::string& path, std::uint8_t full, Levels& levels);

/// An image of a job as levels: those that it carries, or 1 where one of 1 bit is set. full  as in image()
/// errors  of image()
Result<Levels> image_levels(const std::string& path, std::uint8_t full);

/// What grey of others becomes.
struct LevelsRequest {
  std::uint8_t full = 1;   // level of a full voxel, 1 .. 255: black is full, white 0
  bool invert = false;     // white is full
  std::uint64_t page = 0;  // of pages_of(); 0: the file has one image
};

/// The levels of an image of others, of 1 to 16 bits: level = floor(darkness x full + 1/2), in integers, so that a value
/// between two levels takes the nearest. Those of stages/formats/image_format.h come back as they are.
/// keep     kSmaller: an image of 1 bit may be returned as bits, where set pixels are full, in place of its levels
/// returns  the image's resolution; its runs are empty. errors  kInput: of dark_pixels()
Result<Image> nearest_levels(const std::string& path, const LevelsRequest& request, Levels& levels, Keep keep = Keep::kRuns);

/// The places of the images of a file without thumbnails, in their order: of a TIFF of several, else one 0.
/// errors  kInput: not readable, or more than 2^20 images
Result<std::vector<std::uint64_t>> pages_of(const std::string& path);

/// The counts of its darkness, of 255, without the levels themselves.
struct GreyCounts {
  std::uint64_t darkness = 0;  // sum
  std::uint64_t between = 0;   // pixels between white and black
};
/// As nearest_levels() of 255 gives them.
Result<GreyCounts> grey_counts(const std::string& path, std::uint64_t page);

/// What is not set of an image.
Runs inverse(const Runs& image);
void invert(BitImage& image);

/// What an image differs from its manifest in, its pixels or their size first: "12 x 10 pixels, the manifest says 12 x 11";
/// or "".
/// set    pixels that are to be set
/// layer  of the image, and stated by its description where lamina wrote one (stages/formats/tiff/)
std::string difference(const Image& image, const PixelGrid& grid, std::uint64_t set, const Layer& layer);

}  // namespace lamina::formats
