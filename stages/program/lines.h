// stages/program/lines.h: lines of an image as the head passes over them: turned, divided between swaths.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/drop_image.h"
#include "stages/data/levels.h"
#include "stages/data/program.h"
#include "stages/data/runs.h"
#include "stages/program/fire.h"

namespace lamina::program {

/// Scratch for to_scan_frame; keeps its capacity.
struct ScanScratch {
  Runs turned;
  Levels zones;
  DropPatterns patterns;
  Buffer<std::uint32_t> next;
  std::uint64_t bytes() const {
    return bytes_held(turned.row_offset) + bytes_held(turned.change) + bytes_held(next) + zones.bytes() + patterns.bytes();
  }
};

/// Rows of the result are lines, its columns places (data/program.h). The image itself where it is so already.
/// image  of grid.image's size; the result borrows from it or from the scratch
/// cost   nothing, or O(rows + changes), and for a scan along y O(columns + pixels that differ from the one above)
RunsView to_scan_frame(const HeadGrid& grid, const RunsView& image, ScanScratch& scratch);

/// The same of drops; their patterns are turned with them.
DropImageView to_scan_frame(const HeadGrid& grid, const DropImageView& image, ScanScratch& scratch);

/// Columns become rows: row c of the result holds, as columns, the rows of column c.
void transpose(const RunsView& image, Runs& result, Buffer<std::uint32_t>& next);
void transpose(const LevelsView& image, Levels& result, Buffer<std::uint32_t>& next);

enum class LineOperation : std::uint8_t { kUnion, kDifference };

/// Appends what is set in either line, or in `one` and not in `other`. cost  linear
void combine(ColumnChanges one, ColumnChanges other, LineOperation operation, Buffer<std::uint32_t>& result);

std::uint64_t pixels_of(ColumnChanges line);

/// Whether the upper of two swaths fires a place of a line that they share. `share` of 64 places, evenly spread.
constexpr bool upper_fires(std::uint64_t line, std::uint32_t position, std::uint32_t share) {
  const std::uint32_t turned = (position + static_cast<std::uint32_t>(line) * 23) & 63;
  // The order 0, 32, 16, 48, ... puts each further place into the largest gap.
  const std::uint32_t order = ((turned & 1) << 5) | ((turned & 2) << 3) | ((turned & 4) << 1) | ((turned & 8) >> 1) |
                              ((turned & 16) >> 3) | ((turned & 32) >> 5);
  return order < share;
}

/// Appends the places of a line that the upper (or the lower) swath fires.
void divide(ColumnChanges line, std::uint64_t number, std::uint32_t share, bool upper, Buffer<std::uint32_t>& result);

/// The positions of a line that the upper (or the lower) swath fires, bit p % 64.
std::uint64_t allowed_positions(std::uint64_t number, std::uint32_t share, bool upper);

}  // namespace lamina::program
