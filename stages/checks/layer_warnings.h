// stages/checks/layer_warnings.h: warnings that are counted over the layers of a job, without meshes.
//
// codes   chains-open     cuts of layers stay open
//         undivided       segmented lines are too short for the requested pores
//         no-bead         none fits
//         horizontal-face  lies within a micrometre of a sampling plane and is printed in part
//         rows-capped, rows-open  rows of images that only repair closes, or that stay open
//         empty, layers-empty, lost-pixels, cover-top, mixed-powders; volumes, lost parts and bleeds are not in records
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/level_face.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// Counts the layers with a fault and names the first.
struct ReportedLayers {
  std::uint32_t count = 0;
  std::string first;  // "layer 12 at z 0.300 mm"
  std::uint32_t index = 0;
  double z_mm = 0;
  void add(const Layer& layer);
  /// Only if there are any.
  void warn(std::string code, std::string text, std::vector<Warning>& warnings, std::string part = {}) const;
};

/// What toolpaths lack.
struct PathWarnings {
  ReportedLayers open, undivided;

  /// A layer's open chains of cuts, its segmented lines and its thin stretches.
  void add(const Layer& layer, std::uint64_t open_chains, std::uint64_t lines, std::uint64_t thin);
  /// fills  whether walls or lines are requested. moves  of the parts, of all layers. layers  of the job
  void report(bool fills, std::uint64_t moves, std::uint32_t layers, std::vector<Warning>& warnings) const;
};

/// Of layers in their order.
class RowWarnings {
 public:
  /// rows      of the layer; none: nothing is noted
  /// first     of them, counted from the bed's front
  /// instance  whose cap closes it
  void add_capped(const Layer& layer, std::uint32_t rows, std::uint32_t first, std::uint32_t instance, const PixelGrid& grid) {
    if (note(capped_, layer, rows, first, grid)) instance_ = instance;
  }
  void add_open(const Layer& layer, std::uint32_t rows, std::uint32_t first, const PixelGrid& grid) {
    note(open_, layer, rows, first, grid);
  }

  /// The instance whose cap closes the first of the rows.
  std::uint32_t first_capped() const { return instance_; }
  /// part  of that instance
  void report(const std::string& part, std::vector<Warning>& warnings) const;

 private:
  struct Rows {
    std::uint64_t rows = 0;
    ReportedLayers layers;
    std::string position;
  };
  static bool note(Rows& reported, const Layer& layer, std::uint32_t rows, std::uint32_t first, const PixelGrid& grid);

  Rows capped_, open_;
  std::uint32_t instance_ = 0;
};

/// Horizontal faces that sampling planes cut in part. Of layers in their order.
class LevelWarnings {
 public:
  /// face  the largest of the layer. Less than 1 mm2 is not reported
  void add(const Layer& layer, const LevelFace& face);
  /// Of the largest one.
  std::uint32_t owner() const { return largest_.owner; }
  /// part  of that owner
  void report(const std::string& part, std::vector<Warning>& warnings) const;

 private:
  LevelFace largest_;
  ReportedLayers layers_;
  std::string position_;  // of the largest
};

/// Heights at which a part is of one powder: planes from <= z < to, nm, as sections have them.
struct PowderInterval {
  std::int64_t from = 0, to = 0;
  std::uint32_t material = 0;
};

/// Layers [first, last] that belong together.
using LayerRange = std::array<std::uint32_t, 2>;

/// The layers whose planes lie in stretches of more than one material, in order; neighbours are one range. Parts may be hollow
/// or lie under others there: such a layer can have pixels of one material alone.
/// planes  of the layers, increasing
/// cost    sorts the stretches, then one step a layer and a stretch; independent of meshes
std::vector<LayerRange> mixed_layers(std::vector<PowderInterval> intervals, std::uint32_t materials,
                                     std::span<const Nm> planes);

/// Of all layers of an image job, in their order.
class LayerRecords {
 public:
  void add(const Layer& layer, std::uint64_t set_pixels, std::uint64_t lost_pixels, std::uint32_t capped_rows);

  /// Lost pixels and capped rows.
  void report(std::span<const PartSummary> parts, std::vector<Warning>& warnings) const;

  /// Those and the rest. parts  of the manifest: a layer within the height of one is expected to have pixels
  /// thins  beads or a dose may leave layers empty on purpose
  /// errors kInput: no layer has a pixel, and that is not allowed
  Status check(std::span<const PartSummary> parts, bool thins, bool allow_empty, std::vector<Warning>& warnings) const;

 private:
  std::vector<Layer> layers_;
  std::vector<std::uint8_t> filled_;  // by layer
  std::uint64_t lost_ = 0, capped_ = 0;
  ReportedLayers capped_layers_;
};

/// Pixels of blocked nozzles that nothing fires; no warning if there are none.
void warn_of_lost_pixels(std::uint64_t pixels, std::vector<Warning>& warnings);

/// Of a job whose steps lie inside of its parts and whose last layer covers them: where it is empty, or was left out.
/// height  nm, of the parts
void warn_of_open_top(const Layer& last, std::int64_t height, std::vector<Warning>& warnings);

/// No warning if there are none.
void warn_of_unfed(const UnfedPowder& powder, std::vector<Warning>& warnings);

/// Refuses the warnings of a strict job. errors  kVerification with all of them on one line
Status refuse_warnings(std::span<const Warning> warnings);

}  // namespace lamina::checks
