// stages/dose/layer_drops.h: the image of a layer, or the fill fractions of its voxels, becomes a drop image.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/dose/dither.h"
#include "stages/dose/edges.h"
#include "stages/dose/field.h"
#include "stages/dose/saturation.h"
#include "stages/dose/shares.h"
#include "stages/geometry/drop_rows.h"

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

/// A part of a layer that has a dose, or shares of voxels, of its own.
struct DepositedPart {
  Levels shares;  // how full its voxels are
  Levels zones;   // the same, with its core marked
  std::uint32_t zone = 0, material = 0;
  std::uint64_t bytes() const { return shares.bytes() + zones.bytes(); }
};

/// Scratch for the drops of a layer, and what they are; buffers keep their capacity.
struct DropWork {
  Levels shares;  // fill fractions of voxels, if the job requests them
  Levels zones;
  Levels levels;  // drops of each pixel, of parts that share voxels or have formulas
  std::vector<ZonePiece> pieces;
  std::vector<DepositedPart> deposited;
  ShareOut shared;                  // of the parts' shares
  std::vector<Levels> of_material;  // zones or drops of each material, where they are separated
  Levels up_to;                     // drops of the materials so far; scratch
  std::vector<Field> fields;        // two a zone: of its shell, of its core
  PourScratch pour;

  // --- what pixels get, of the last layer; of other functions than the first three below, none
  DropPatterns patterns;
  DropCounter counter;
  std::vector<DropImageView> drops;  // of all materials; then of each, where they are separated
  /// Whether there are any.
  bool dosed() const { return !drops.empty(); }
  std::uint64_t bytes() const;
};

/// Common to the layers of a job.
struct DropRules {
  std::uint8_t full = 0;        // level of a full voxel in DropWork::shares; 0: pixels of the image are full
  bool dithered = true;         // else drops are rounded to whole ones
  Reach shell;                  // empty: all is core
  std::uint32_t max_drops = 0;  // of any pixel of the job
  bool thins = false;           // the core gets a share of its drops
};

/// Distributes the voxels among the parts in work.deposited, of which each overrides those before: shares.h. After more parts
/// are added, another call gives what one call with all of them would.
void share_out(std::uint8_t full, std::uint32_t columns, std::uint32_t rows, DropWork& work);

/// What the images of a layer have at most, before it gets its drops.
struct DropSizes {
  std::uint64_t rows = 0, columns = 0;
  std::uint64_t edges = 0;   // changes of the image, or of one of the voxels of some level and more
  std::uint64_t runs = 0;    // of the shares of voxels of all parts, if there are any
  std::uint64_t pixels = 0;  // that get drops which are not whole
  bool zones = false;        // of several doses, or moved edges or axes
  std::uint32_t doses = 1;
  std::uint32_t parts = 0;      // in DropWork::deposited
  std::uint32_t materials = 1;  // whose drops are separated
};

/// What it has at most with them; buffers double as they grow.
struct DropBound {
  std::uint64_t changes = 0;         // of the first plane, or runs of its drops as levels
  std::uint64_t changes_of_all = 0;  // of the planes together
  std::uint64_t runs = 0;            // of its zones; 0: it has none
  std::uint64_t bytes = 0;           // of DropWork and the image
};
DropBound bound_of(const DropRules& rules, const DropSizes& sizes);

/// Gives `image` the voxels of work.shares that are half full or more. second  scratch
/// returns  where it was another one: pixels whose centres say something else than their voxels
Difference take_half(std::uint8_t full, Runs& image, Runs& second, const DropWork& work);

/// The drops of a layer. Of shares, the image is that of take_half() without its bleed, and the core is measured from its edge.
/// second  scratch; work.shares is lost, and work.zones has what was dosed
ZoneSums drops_of_layer(const DropRules& rules, const LayerDose& dose, std::uint32_t layer, const Runs& image, Runs& second,
                        DropWork& work);

/// The same of parts that get different doses; no shares of voxels.
/// doses, zone  of each of them; no pixel is in two of the images, and together they are `image`; at most 127
ZoneSums drops_of_parts(const DropRules& rules, std::span<const LayerDose> doses, std::uint32_t layer,
                        std::span<const Runs> zone, const Runs& image, Runs& second, DropWork& work);

/// The same of parts in work.deposited that share voxels, or whose doses are formulas. The image is that of all of them.
/// requests   of each zone, shell and core; work.zones becomes the levels of all parts together
/// materials  whose drops are separated: of a voxel's drops the first are those of the first material, so that each gets them
///            in proportion to its share over many voxels
/// errors     of pour()
Result<ZoneSums> drops_of_deposited(const DropRules& rules, const Sheet& sheet,
                                    std::span<const std::array<DropRequest, 2>> requests, std::uint32_t materials,
                                    const Runs& image, Runs& second, DropWork& work);

/// One drop a pixel in the shell, and a share of them in the core. second  scratch
void drops_of_core(const DropRules& rules, double share, std::uint32_t layer, const Runs& image, Runs& second, DropWork& work);

/// Separates the drops of materials that share no voxel: all drops of a pixel are of the one that it is of.
/// image  of each material, its pixels
/// cost   O((runs + rows) x materials)
void separate_materials(std::span<const Runs> image, DropWork& work);

}  // namespace lamina::dose
