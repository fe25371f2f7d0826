// stages/dose/zones.h: parts of a layer that get different doses become one image of levels.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/levels.h"
#include "stages/data/runs.h"

namespace lamina::dose {

/// A piece of a row; scratch of join_zones().
struct ZonePiece {
  std::uint32_t begin = 0, end = 0;
  std::uint8_t level = 0;
};

/// Image i at level i + 1.
/// images  of one size, no pixel is set in two; at most 255
/// cost    O(rows x images + changes x log(images))
void join_zones(std::span<const Runs> images, std::vector<ZonePiece>& scratch, Levels& result);

}  // namespace lamina::dose
