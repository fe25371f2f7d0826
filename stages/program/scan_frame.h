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

/// Columns become rows: row c of the result holds, as columns, the rows of column c.
void transpose(const RunsView& image, Runs& result, Buffer<std::uint32_t>& next);

}  // namespace lamina::program
