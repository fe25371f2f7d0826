// stages/dose/shares.h: images of how full voxels are, on their way from coverage to drops, on runs.
//
// Of L levels, n = L - 1 is that of a full voxel: `full` below. A zone is a level in the shell, or n more in the core.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/dose/saturation.h"

namespace lamina::dose {

/// The lowest level of a voxel that counts as set without dithering: its share rounds to half or more.
constexpr std::uint8_t half_of(std::uint8_t full) { return static_cast<std::uint8_t>((full + 1) / 2); }

/// x: columns are reversed; y: rows are reversed. cost  O(runs + rows)
void mirror(const LevelsView& image, bool x, bool y, Levels& result);

/// Levels where the mask is not set; 0 elsewhere. mask  of the same size. cost  O(runs)
void without(const LevelsView& image, const RunsView& mask, Levels& result);
/// Levels where it is set. The same cost.
void within(const LevelsView& image, const RunsView& mask, Levels& result);

/// Zones of levels 1 .. full: those within the core get `full` more. core  of the same size. cost  O(runs)
void mark_core(const LevelsView& image, const RunsView& core, std::uint8_t full, Levels& result);

/// Drops a pixel of each zone: in proportion to the level, of a shell's or a core's full voxel.
/// dithered  false: rounded to whole drops, half a drop up
/// drops     2 full + 1 entries
void drops_of_zones(const LayerDose& dose, std::uint8_t full, bool dithered, std::span<Drops24> drops);

/// What a layer's zones come to.
struct ZoneSums {
  std::uint64_t full_voxels = 0;      // sum of levels / full, rounded
  std::uint64_t requested_drops = 0;  // for them, rounded, however many may be jetted
};
ZoneSums sums_of(const LevelsView& zones, std::uint8_t full, const LayerDose& dose);

/// Parts of a layer, in the order in which they are added, whose voxels have one sum.
struct ShareOut {
  std::vector<Levels> part;  // scratch
  std::vector<Runs> owner;   // of each part, the voxels half full or more of which it has most; of equals the last
  std::uint64_t bytes() const;
};
/// Takes from parts what is too much: the last one keeps its level, and each one before it has at most what is left to `full`.
/// parts  of one size; total  the sums, 1 .. full
/// cost   O((rows + runs of all) x parts)
void share_out(std::span<Levels* const> parts, std::uint8_t full, ShareOut& out, Levels& total);

/// What pixels of `all` have more than those of `some`, which have at most as much. Both of one size. cost  O(rows + runs)
void surplus(const Levels& all, const Levels& some, Levels& result);

/// Pixels of two images that differ.
struct Difference {
  std::uint64_t pixels = 0;
  std::uint64_t far = 0;  // where all nine pixels around are equal in the first image: no boundary of it is near
};
/// a, b  of the same size. cost  O(changes)
Difference difference(const RunsView& a, const RunsView& b);

struct ShareCount {
  std::uint64_t full_voxels = 0;   // that the levels come to
  std::uint64_t half_differs = 0;  // of take_half(): voxels half full or more against pixels whose centre is set
  std::uint64_t half_far = 0;      // of these, those away from any boundary
  double differing_share() const {
    return full_voxels > 0 ? static_cast<double>(half_differs) / static_cast<double>(full_voxels) : 0;
  }
  void add(std::uint64_t more_full, std::uint64_t more_differs, std::uint64_t more_far) {
    full_voxels += more_full, half_differs += more_differs, half_far += more_far;
  }
};

}  // namespace lamina::dose
