// stages/dose/pour.h: what several doses come to in a layer: their drops are added up, voxel by voxel, and dithered as one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/levels.h"
#include "stages/data/status.h"
#include "stages/dose/dither.h"
#include "stages/dose/field.h"
#include "stages/dose/saturation.h"
#include "stages/dose/shares.h"

namespace lamina::dose {

/// The request of a full pixel, without the limit of drops: a number of them, or a formula's.
struct DropRequest {
  Drops24 drops = 0;
  Field* field = nullptr;
};

/// A part of a layer: levels 1 .. full in its shell, full more in its core.
struct Dosed {
  LevelsView zones;
  DropRequest shell, core;
};

/// Scratch; keeps its capacity.
struct PourScratch {
  struct DosePiece {
    std::uint32_t begin = 0, end = 0;
    std::uint32_t level = 0;
    Drops24 drops = 0;  // at most as many as may be jetted
  };
  struct Change {
    std::uint32_t at = 0;
    std::int32_t level = 0;
    std::int64_t drops = 0;
  };
  std::vector<DosePiece> pieces;
  std::vector<Change> changes;
  Thresholds thresholds;
  std::uint64_t bytes() const;
};

/// Drops of each pixel: those of its parts, each in proportion to its level, dithered (dither.h) or rounded as a sum.
/// parts   of one size; where several share a voxel, their levels come to `full` at most
/// result  drops a pixel; levels  of all parts together, 1 .. full
/// errors  kUsage: a formula has no number of per cent where a part lies, or one that does not bind
/// cost    O(rows x parts + runs log(parts) + blocks of formulas + dithered pixels)
Result<ZoneSums> pour(std::span<const Dosed> parts, std::uint8_t full, const Sheet& sheet, PourScratch& scratch, Levels& result,
                      Levels& levels);

}  // namespace lamina::dose
