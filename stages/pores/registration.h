// stages/pores/registration.h: shifts at which a box of voxels covers another, and an image covers itself.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/runs.h"
#include "stages/data/voxels.h"

namespace lamina::pores {

/// How two boxes lie upon each other. Voxels of the smaller one that are set in it alone, or in the larger one alone.
struct Match {
  std::array<std::int32_t, 3> shift{};  // voxels: of the smaller one's content in the larger one, from its middle
  std::uint64_t only_small = 0, only_large = 0;
  std::uint64_t differing() const { return only_small + only_large; }
};

/// The shift at which both boxes have most nearly the same solid in each block of 4 x 4 x 4 voxels: least squares. So a larger
/// box whose walls have grown evenly lies in the middle of the places that it covers. Of equal ones that of fewest voxels that
/// differ, then the smallest.
///
/// Compares all shifts of up to `range` voxels along each axis in voxels that are 2^k as large (pores/rows.h), as large as
/// range and boxes allow, in blocks of the same size, at least a voxel; then around the best of these in finer and finer ones,
/// two steps each way. What repeats within the range has several such places. small  voxel x, y, z lies upon x + range, ... of
/// `large` without a shift large  2 range longer along each axis cost   O(runs + voxels / 64) for each shift, shifts in
/// parallel; the same result for any number of threads
Match find_shift(const VoxelView& small, const VoxelView& large, std::uint32_t range);

// --- after how far a pattern repeats.

/// The smallest shift along an axis of an image, in pixels, at which nearly all of it covers itself.
///
/// columns  the shift is along rows, else across them
/// minimum  shifts below this are not considered, nor those above two fifths of the image: three periods have to be there
/// miss     share of the set pixels that may differ, and no more than 15 % of what differs at the worst shift; of several
///          shifts in a row that pass, the one that differs least is taken
/// returns  `minimum` for an image that is the same all along; 0 if there is no period, or the image is empty or full
/// cost     O(runs) a shift
std::uint32_t period(const RunsView& image, bool columns, std::uint32_t minimum, double miss);

/// The share of the set pixels of two images of one size that are set in one of them alone, of those of both; 0 of empty ones.
double mismatch(const RunsView& one, const RunsView& other);

}  // namespace lamina::pores
