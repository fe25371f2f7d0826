// stages/view/depth.h: three views of parts, computed from their layers.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/runs.h"
#include "stages/geometry/coverage.h"

namespace lamina::view {

/// Nearness of the surface in each pixel of a view; 0 without a surface. Rows from the top.
struct DepthView {
  std::string name;  // top, front, side
  std::uint32_t width = 0, height = 0, maximum = 1;
  double width_mm = 0, height_mm = 0;
  std::vector<std::uint16_t> depth;
};

/// Layers are sampled as coverage on a grid of at most 360 x 360 cells over the window around all of them; a cell at
/// least half set is solid.
class ThreeViews {
 public:
  /// `window` not empty; heights in nm above the bed.
  ThreeViews(const PixelGrid& grid, const PixelWindow& window, Nm bottom, Nm top);

  std::uint32_t columns() const { return columns_; }
  std::uint32_t rows() const { return rows_; }

  /// The coverage of a layer, columns() x rows() values; for any thread.
  void inspect(RowRuns image, std::vector<std::uint8_t>& cells) const;
  /// Adds a sampled layer; in any order, from one thread at a time.
  void add(const Layer& layer, const std::vector<std::uint8_t>& cells);

  const std::array<DepthView, 3>& views() const { return views_; }

 private:
  PixelWindow window_;
  std::uint32_t columns_, rows_, levels_;
  Nm bottom_, top_;
  std::array<DepthView, 3> views_;
};

}  // namespace lamina::view
