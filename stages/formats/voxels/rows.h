// stages/formats/voxels/rows.h: rows of a box of voxels as bytes, for what is written voxel by voxel; internal to this folder.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "stages/data/voxels.h"

namespace lamina::write::voxels {

/// Which voxels of a box are meant: the set ones, or the others.
enum class Side : std::uint8_t { kSolid, kVoid };

/// Puts a row into nx bytes: 1 where it is of that side, else 0.
inline void expand_row(std::span<const std::uint32_t> changes, Side side, std::span<std::uint8_t> bytes) {
  const auto outside = static_cast<std::uint8_t>(side == Side::kVoid), inside = static_cast<std::uint8_t>(1 - outside);
  std::ranges::fill(bytes, outside);
  for (std::size_t i = 0; i + 1 < changes.size(); i += 2) {
    std::fill(bytes.begin() + changes[i], bytes.begin() + changes[i + 1], inside);
  }
}

}  // namespace lamina::write::voxels
