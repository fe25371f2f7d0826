// stages/dose/layer_drops.h: the image of a layer, or how full its voxels are, becomes the images of its drops.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/dose/dither.h"
#include "stages/dose/erode.h"
#include "stages/dose/shares.h"
#include "stages/dose/wish.h"
#include "stages/dose/zones.h"

namespace lamina::dose {

/// Scratch for the drops of a layer, and what they are; buffers keep their capacity.
struct DropWork {
  Levels shares;  // how full voxels are, if the job asks for that
  Levels zones;
  Levels levels;  // drops of each pixel, where any of the job gets several
  DitherScratch dither;
  std::vector<ZonePiece> pieces;
  std::vector<Runs> planes;  // then: the pixels with at least one drop, two, ...: as many as the job has
  std::uint64_t bytes() const;
};

/// Common to the layers of a job.
struct DropRules {
  std::uint8_t full = 0;         // level of a full voxel in DropWork::shares; 0: pixels of the image are full
  bool dithered = true;          // else drops are rounded to whole ones
  Reach shell;                   // empty: all is core
  std::uint32_t most_drops = 0;  // of any pixel of the job
};

/// Gives `image` the voxels of work.shares that are half full or more. second  scratch
/// returns  where it was another one: pixels whose centres say something else than their voxels
Difference take_half(std::uint8_t full, Runs& image, Runs& second, const DropWork& work);

/// The drops of a layer in place of its image, which becomes that of the first drop. Of shares, the image is that of
/// take_half() without its bleed, and the core is measured from its edge. second  scratch; work.shares is lost
ZoneSums drops_of_layer(const DropRules& rules, const LayerDose& dose, std::uint32_t layer, Runs& image, Runs& second,
                        DropWork& work);

/// The same of parts that get different doses; no shares of voxels.
/// doses, zone  of each of them; no pixel is in two of the images, and together they are `image`; at most 127
ZoneSums drops_of_parts(const DropRules& rules, std::span<const LayerDose> doses, std::uint32_t layer,
                        std::span<const Runs> zone, Runs& image, Runs& second, DropWork& work);

}  // namespace lamina::dose
