// stages/view/picture/layout.h: where things stand on a contact sheet.
#pragma once

#include <cstdint>

#include "stages/data/grid.h"
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

/// `window` and a margin around it, within the bed. The whole bed if the window is empty.
PixelWindow with_margin(const PixelWindow& window, const PixelGrid& grid);

/// A sheet at most `width` wide of `cells` pictures of `window`, as near to the proportion 3 : 2 as their shape allows.
SheetLayout layout_chart(int cells, const PixelWindow& window, const PixelGrid& grid, int width);

}  // namespace lamina::view::picture
