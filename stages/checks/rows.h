// stages/checks/rows.h: rows of images that only repair closes, or that stay open, with the place of the first.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// Of layers in their order.
class RowWarnings {
 public:
  /// rows      of the layer; none: nothing is noted
  /// first     of them, counted from the bed's front
  /// instance  whose cap closes it
  void add_capped(const Layer& layer, std::uint32_t rows, std::uint32_t first, std::uint32_t instance, const PixelGrid& grid) {
    if (note(capped_, layer, rows, first, grid)) instance_ = instance;
  }
  void add_open(const Layer& layer, std::uint32_t rows, std::uint32_t first, const PixelGrid& grid) {
    note(open_, layer, rows, first, grid);
  }

  /// The instance whose cap closes the first of the rows.
  std::uint32_t first_capped() const { return instance_; }
  /// part  of that instance
  void report(const std::string& part, std::vector<Warning>& warnings) const;

 private:
  struct Rows {
    std::uint64_t rows = 0;
    std::uint32_t layers = 0, layer = 0;  // layer: the first
    double z_mm = 0;
    std::string position;
  };
  static bool note(Rows& reported, const Layer& layer, std::uint32_t rows, std::uint32_t first, const PixelGrid& grid);

  Rows capped_, open_;
  std::uint32_t instance_ = 0;
};

}  // namespace lamina::checks
