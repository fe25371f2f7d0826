// Voxels one by one, and their layers as runs.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/runs.h"

namespace lamina::checks {

struct Volume {
  std::uint32_t columns, rows, layers;
  std::vector<std::uint8_t> set;
  bool at(std::int64_t c, std::int64_t r, std::int64_t l) const {
    if (c < 0 || r < 0 || l < 0 || c >= columns || r >= rows || l >= layers) return false;
    return set[static_cast<std::size_t>((l * rows + r) * columns + c)] != 0;
  }
  Runs layer(std::uint32_t l) const {
    Runs runs;
    runs.columns = columns;
    runs.row_offset.push_back(0);
    for (std::uint32_t r = 0; r < rows; ++r) {
      for (std::uint32_t c = 0; c <= columns; ++c) {
        if (at(c, r, l) != at(std::int64_t{c} - 1, r, l)) runs.change.push_back(c);
      }
      runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
    }
    return runs;
  }
};

}  // namespace lamina::checks
