// stages/program/scan_frame.h: an image as the head passes over it.
#pragma once

#include "stages/data/program.h"
#include "stages/data/runs.h"

namespace lamina::program {

/// Scratch for to_scan_frame; keeps its capacity.
struct ScanScratch {
  Runs turned;
  Buffer<std::uint32_t> next;
};

/// Rows of the result are lines, its columns places (data/program.h). The image itself where it is so already.
/// image  of grid.image's size; the result borrows from it or from the scratch
/// cost   nothing, or O(rows + changes), and for a scan along y O(columns + pixels that differ from the one above)
RunsView to_scan_frame(const HeadGrid& grid, const RunsView& image, ScanScratch& scratch);

/// The pixel of the image (column, row from the back) at a place of a line.
struct Pixel {
  std::uint32_t column, row;
};
inline Pixel pixel_at(const HeadGrid& grid, std::uint32_t line, std::uint32_t place) {
  const bool x = grid.scan_axis == ScanAxis::kX;
  const std::uint32_t l = grid.lines_from_end ? grid.lines - 1 - line : line;
  // Places of a scan along y count from the front unless they count from the end; image rows count from the back.
  const std::uint32_t p = (x ? grid.places_from_end : !grid.places_from_end) ? grid.places - 1 - place : place;
  return x ? Pixel{p, l} : Pixel{l, p};
}

/// Columns become rows: row c of the result holds, as columns, the rows of column c.
void transpose(const RunsView& image, Runs& result, Buffer<std::uint32_t>& next);

}  // namespace lamina::program
