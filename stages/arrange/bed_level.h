// stages/arrange/bed_level.h: one level of a bed, filled with shapes from the front left.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stages/arrange/openings.h"
#include "stages/arrange/search_shape.h"
#include "stages/arrange/silhouette.h"

namespace lamina::arrange {

/// Cells of a bed where no part may be. All lengths nm from the corner of the bed.
struct BedCells {
  BitShape blocked;
  std::int64_t cell = 0;
  std::int64_t x0 = 0, y0 = 0;  // of the first cell
};

struct BedOutline {
  std::int64_t width = 0, depth = 0, margin = 0;
  bool round = false;  // an ellipse within width x depth
};
/// A box where nothing may be, nm on the bed.
struct KeepOut {
  std::int64_t lo_x = 0, lo_y = 0, hi_x = 0, hi_y = 0;
};
/// A cell is free if all of it is on the bed, out of the margin and of all boxes.
BedCells bed_cells(const BedOutline& bed, std::span<const KeepOut> keep_out, std::int64_t cell);

/// Position of a shape's first cell.
struct CellPosition {
  std::uint32_t x = 0, y = 0;
};

/// One level. Shapes only come, so the first free position of a shape never moves back: a search continues where the last one
/// of the same shape ended.
class BedLevel {
 public:
  /// shapes  that may come, by number
  BedLevel(const BedCells& bed, std::size_t shapes);

  /// The front-most position of a shape, of several the left-most; none if there is none.
  /// below    of no use: positions whose last row is beyond it
  /// cost     for each row that is tried, the words of the bed, and a few runs of the shape where its largest square is free
  std::optional<CellPosition> find(std::size_t number, const SearchShape& shape, std::uint32_t below = UINT32_MAX);
  /// Whether a shape has any position.
  bool has_space(const SearchShape& shape);
  /// Whether a shape is on the bed and free there.
  bool is_free(const BitShape& shape, CellPosition at) const;
  /// Blocks the shape and what is nearer than the gap.
  void put(const GrownShape& grown, CellPosition at);

 private:
  std::optional<CellPosition> find_from(CellPosition& next, const SearchShape& shape, std::uint32_t below);

  Openings openings_;
  std::vector<CellPosition> next_;  // by number of the shape
};

}  // namespace lamina::arrange
