// stages/arrange/openings.h: where squares of several sizes are free on a bed.
//
// A shape is only compared with the bed where the largest square in it is free.
#pragma once

#include <array>
#include <cstdint>

#include "stages/arrange/silhouette.h"

namespace lamina::arrange {

/// Cells where a square of a size cannot have its front left cell, for sizes 1, 2, 3, 4, 6, 8, 12 .. 384; each is made from
/// the one before where rows changed since it was last requested.
class Openings {
 public:
  /// taken  cells of the bed
  explicit Openings(const BitShape& taken);

  const BitShape& taken() const { return maps_[0].blocked; }
  /// Takes cells of a row.
  void take(std::uint32_t y, std::uint32_t begin, std::uint32_t end);
  /// Blocked cells of the largest of the sizes that is not above `square`, >= 1.
  /// cost  O(words of the rows that changed) a size
  const BitShape& blocked_for(std::uint32_t square);

 private:
  static constexpr std::array<std::uint32_t, 18> kSizes{1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 320, 384};
  struct SquareMap {
    BitShape blocked;
    std::uint32_t from = 0, to = 0;  // rows that changed: [from, to)
  };
  void refresh(std::size_t number);

  std::array<SquareMap, kSizes.size()> maps_;
};

}  // namespace lamina::arrange
