// pipeline/manifest/record.h: the record of one layer in a manifest.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/lost_features.h"
#include "stages/data/toolpaths.h"
#include "stages/formats/extrusion_format.h"
#include "stages/support/hash/hash.h"

namespace lamina {

struct LayerOverhang;  // stages/data/overhang.h

/// The print program of a layer, for a job with a machine.
struct ProgramRecord {
  std::uint64_t bytes = 0;  // expanded, as the hash
  Hash128 hash;
  std::uint64_t stored = 0;  // bytes of the file as it was just written; in no manifest, since they depend on libzstd
  std::uint32_t sweeps = 0;  // that fire
  std::uint64_t drops = 0;
  std::uint64_t moved = 0, lost = 0;  // pixels of blocked nozzles (stages/program/compile.h)
  std::int64_t microseconds = 0;      // that the machine takes (stages/replay/time/timer.h)
  std::uint64_t spat = 0;             // drops fired off the bed
  /// Of heads that fire several drops: sweeps that are there for their frequency (data/program.h), and what they take.
  std::uint32_t added_sweeps = 0;
  std::int64_t added_microseconds = 0;
};

/// The image of one material where a job has several, of the pixels that get at least so many drops, or both.
struct ImageRecord {
  std::uint64_t bytes = 0, set_pixels = 0;
  std::uint64_t unfed_pixels = 0;  // of the set ones, in the powder of another vat; of a job with a machine
  std::uint64_t drops = 0;         // of a grey image of one material
  Hash128 hash;
};

/// The pores of a layer in the areas that lie in one range of heights.
struct RangePores {
  double area_mm2 = 0;  // within their contours
  PoreCounts pores;
};

/// Contours and toolpaths of a layer.
struct PathFacts {
  std::uint64_t contours = 0, points = 0, paths = 0, merged = 0, open = 0;  // merged: bodies that needed a union
  double area_mm2 = 0;                                                      // within the contours
  double bead_mm = 0;                                                       // length of the stored toolpaths, of contours only

  // --- toolpaths of an extrusion printer
  std::uint64_t stored_points = 0;
  formats::MoveTotals totals;
  DepositedSums deposited;
  /// By segmented range of heights, in a job whose layers can hold several; else empty, and not summed.
  std::vector<RangePores> by_range;
  LostFeatures lost;                                       // of layers that this run made; in no manifest, and not summed
  std::shared_ptr<const LayerOverhang> overhang;  // null of layers that an earlier run made; in no manifest, and not summed

  /// Sums the fields. Summed in layer order, the result is deterministic.
  void add(const PathFacts& other) {
    contours += other.contours;
    points += other.points;
    paths += other.paths;
    merged += other.merged > 0 ? 1 : 0;
    open += other.open;
    area_mm2 += other.area_mm2;
    bead_mm += other.bead_mm;
    stored_points += other.stored_points;
    totals.add(other.totals);
    deposited.add(other.deposited);
  }
};

struct LayerRecord {
  Layer layer{};
  std::uint64_t bytes = 0;   // of the layer's files, or of its range in the single file
  std::uint64_t offset = 0;  // start of that range
  Hash128 hash;              // of the file or range; zero if a layer has several images

  // --- images
  std::uint64_t set_pixels = 0;
  std::uint32_t capped_rows = 0;           // rows closed only by repair (stages/load)
  ProgramRecord program;                   // zeros without a machine
  std::vector<ImageRecord> images;         // of materials, of drops, or of the drops of each material (ManifestHead)
  std::vector<std::uint64_t> part_pixels;  // to be filled of each part, of a job with prices and several parts; else empty

  // --- images of a job with a saturation, or of shares of voxels
  std::uint64_t dosed_pixels = 0;         // that are to be filled, whether or not drops fall on them; voxels' shares summed
  std::uint64_t drops = 0;                // of the images
  std::uint64_t requested_drops = 0;      // by the target saturation, rounded
  std::uint32_t max_drops = 0;            // of any pixel
  std::vector<std::uint64_t> part_drops;  // of each part, where there are part_pixels
  std::uint64_t geometry_pixels = 0;      // set in the image, of a job whose images are of the geometry
  std::uint64_t half_differs = 0;         // pixels whose centre says something else than half of their voxel
  std::uint64_t half_far = 0;             // of them, those that are not adjacent to a boundary of the image

  /// Of a job of so many materials, the first image of each: the pixels that get any drop of it.
  const ImageRecord& image_of(std::size_t material, std::size_t materials) const {
    return images[material * (images.size() / materials)];
  }
  std::vector<std::uint64_t> pixels_of_materials(std::size_t materials) const {
    std::vector<std::uint64_t> pixels(materials);
    for (std::size_t m = 0; m < materials; ++m) pixels[m] = image_of(m, materials).set_pixels;
    return pixels;
  }
  std::uint64_t drops_of(std::size_t material, std::size_t materials) const {
    const std::size_t each = images.size() / materials;
    std::uint64_t sum = 0;
    for (std::size_t i = material * each; i < (material + 1) * each; ++i)
      sum += images[i].drops > 0 ? images[i].drops : images[i].set_pixels;
    return sum;
  }

  std::shared_ptr<const PathFacts> paths;  // null for images

  /// Pixels that are to be filled: where less than a drop a pixel falls, more than are set; of shares of voxels, fewer.
  std::uint64_t filled_pixels() const { return drops > 0 || dosed_pixels > 0 ? dosed_pixels : set_pixels; }
};

}  // namespace lamina
