// stages/program/lines.h: lines of an image as the head passes over them: turned, divided between swaths, as bits of drops.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/program.h"
#include "stages/data/runs.h"
#include "stages/program/fire.h"

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

// --- lines of drops become lines of the bits of their number.

/// What each nozzle of a sweep fires, as a line for each bit of the number of drops, the lowest first. Flat, kept from sweep to
/// sweep.
class DropBits {
 public:
  /// Most bits of a number of drops.
  static constexpr std::uint32_t kMax = 4;

  /// bits  1 .. kMax
  void begin(std::uint32_t bits);
  /// The next nozzle. drops  line k, from 0, has the places of more than k drops, each within the one before; fewer than
  /// 2 ^ bits. cost  O(drops x changes)
  void add(std::span<const ColumnChanges> drops);
  /// The lines of all nozzles added, those of the lowest bit first; they live until begin().
  /// nozzle  of nozzles x bits
  void end(std::span<ColumnChanges> nozzle) const;

  std::uint64_t bytes() const;

 private:
  std::uint32_t bits_ = 1;
  std::array<Buffer<std::uint32_t>, kMax> change_;  // of all nozzles, for each bit
  std::array<Buffer<std::uint32_t>, kMax> end_;     // where those of a nozzle end
  std::vector<std::size_t> next_;
};

}  // namespace lamina::program
