// stages/view/picture/contact_sheet.h: layers side by side, for people.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stages/data/bit_rows.h"
#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/levels.h"
#include "stages/data/status.h"
#include "stages/geometry/coverage.h"

namespace lamina::view::picture {

/// All in pixels of the sheet.
struct SheetLayout {
  int width, height;
  int margin;  // around all
  int gap;     // between cells
  int title_size, title_height;
  int caption_size, caption_height;   // below each cell
  int columns;                        // of cells
  int cell_width, cell_height;        // without caption
  int picture_width, picture_height;  // centred within the cell

  int cell_left(int cell) const { return margin + cell % columns * (cell_width + gap); }
  int cell_top(int cell) const { return margin + title_height + cell / columns * (cell_height + caption_height + gap); }
};

/// A sheet at most `width` wide of `cells` pictures of `window`, as near to the proportion 3 : 2 as their shape allows.
SheetLayout layout_chart(int cells, const PixelWindow& window, const PixelGrid& grid, int width);

struct SheetLayer {
  std::vector<std::string> paths;  // of the images, whose levels are added up: one a drop of a pixel, or one of all
  std::string name, remark;        // below the cell, on the left and on the right
  bool warns = false;              // drawn in orange, its name too
  std::uint64_t bytes = 0;         // memory that its images take at most
};

struct SheetRequest {
  std::string title;               // above all
  std::vector<SheetLayer> layers;  // one or more, in the order of the sheet
  PixelGrid grid;                  // of the bed; all images are of its size
  std::uint8_t maximum = 1;        // level of a pixel that is drawn as set; those below are paler by their share of it
  bool whole_bed = false;          // else the part of it that holds what is set in any of the layers, and a margin
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;  // of layers that are read
  std::uint32_t width = 2400;      // pixels of the sheet; a single layer is never made larger than its pixels
};

/// An image as levels, or of a layer of one image, as rows of bits that are added up: each within the one before.
struct SheetImage {
  Levels levels;
  std::vector<std::shared_ptr<const BitRows>> planes = {};

  std::uint32_t columns() const { return planes.empty() ? levels.columns : planes.front()->columns(); }
  std::uint32_t rows() const { return planes.empty() ? levels.view().rows() : planes.front()->rows(); }
};

/// A PNG of the layers. All cells show the same part of the bed at the same scale; each of its pixels is as dark as
/// the share of its area that is set, or the mean of levels / most over it. The bytes depend on the images, the request and the
/// versions of OpenImageIO and of the font alone.
/// read    the image of a file of request.layers[layer], 1 where one of 1 bit is set; called from any thread
/// errors  those of `read`; kVerification if an image is not of the bed's size, or a pixel has a level above the most
/// cost    two readings of each image, on all processors; memory is the picture and the runs of the images being read
using ReadImage = std::function<Result<SheetImage>(std::size_t layer, const std::string& path)>;
Result<Buffer<std::byte>> contact_sheet(const SheetRequest& request, const ReadImage& read);

}  // namespace lamina::view::picture
