// pipeline/run/layer_imager.h: the steps of a layer's images: from solids to images per material and drops.
#pragma once

#include <memory>
#include <optional>

#include "pipeline/output/image_files.h"
#include "pipeline/plan/layers.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/image_observers.h"
#include "stages/checks/thin.h"
#include "stages/coverage/coverage.h"
#include "stages/data/bit_image.h"
#include "stages/data/runs.h"
#include "stages/raster/images.h"
#include "stages/raster/raster.h"

namespace lamina::pipeline {

/// Scratch for the images of a layer; reused by later layers.
struct ImageWork {
  raster::LayerScratch scratch;
  Runs runs;             // the image of all materials
  std::optional<BitImage> bits;     // in place of it, where runs would take more memory: LayerImager::keeps_bits()
  Runs second;           // of the other engine, mirrored, or before the dose
  Runs third;            // the core of a layer with a shell
  Runs lowest, highest;  // sections at both ends of the layer, if steps must lie inside or outside
  Runs section;          // of one solid of a layer with several materials
  std::optional<BitImage> section_bits;  // in place of it
  dose::DropWork drops;  // if a saturation or fill fractions of voxels are requested
  coverage::CoverageScratch coverage;
  raster::MaterialImages materials;
  raster::MaterialImages zones;  // of parts with doses of their own
  dose::BleedWork bleed;
  checks::VanishScratch vanish;     // if edges move inwards
  std::unique_ptr<BeadWork> beads;  // if beads fill parts

  /// Capacity of its buffers.
  std::uint64_t bytes() const;
};

/// The steps of a layer's images; const, usable from any thread with separate work objects.
class LayerImager {
 public:
  /// The plan must outlive this object. bits  whether the caller takes images as bits
  explicit LayerImager(const Plan& plan, bool bits = false) : plan_(plan), keeps_bits_(bits && takes_bits()) {}

  // --- in this order; contours, fill and beads only if beads fill the parts
  /// errors  kVerification: engines disagree
  Status raster(const Layer& layer, ImageWork& work, LayerRecord& record, ImageNotes& notes) const;
  /// Of a job of shares of voxels: the image becomes that of voxels half full or more.
  void shares(const Layer& layer, ImageWork& work, LayerRecord& record) const;
  /// The section of all solids at points between pixels and layers, into work.second: kSamples of them, spread evenly along x,
  /// y, z and their diagonals.
  static constexpr std::uint32_t kSamples = 3;
  void sample(const Layer& layer, std::uint32_t number, ImageWork& work) const;
  /// Whether there are such samples: parts are sections of meshes, and no closer than a pixel to the edges of the bed.
  bool samples() const;
  /// Merges the layer with those of the parts that are images, whose pixels it adds to notes.part_pixels, if those are wanted.
  /// errors  kInput: an image cannot be read; kUsage: it sets pixels outside of the bed
  Status images(const Layer& layer, ImageWork& work, ImageNotes& notes) const;
  Status contours(const Layer& layer, ImageWork& work) const;
  Status fill(const Layer& layer, ImageWork& work) const;
  Status beads(const Layer& layer, ImageWork& work, ImageNotes& notes) const;
  /// Mirrors the image and removes its bleed. errors  kUsage: it would grow beyond the bed
  Status bleed(const Layer& layer, ImageWork& work, ImageNotes& notes) const;
  /// Gives pixels their drops, in work.drops.drops, where they are not one a pixel, and counts them. errors  kUsage: of
  /// DosePlan::saturate
  Status dose(const Layer& layer, ImageWork& work, LayerRecord& record) const;
  /// Runs all steps.
  Status make(const Layer& layer, ImageWork& work, LayerRecord& record, ImageNotes& notes) const;

  /// How full the voxels of a layer are, in Job::levels levels, before anything is mirrored or thinned.
  /// The plan's job requests levels.
  coverage::CoverageReport levels(const Layer& layer, coverage::CoverageScratch& scratch, Levels& image) const;

  static constexpr std::uint64_t kUnknown = UINT64_MAX;
  /// Upper bound of the bytes for scratch and runs of a layer.
  /// pixels  that blue noise may part (DosePlan::parted_pixels), 0 before the dose, or kUnknown
  std::uint64_t bytes_of(const Layer& layer, std::uint64_t pixels) const;
  /// Upper bound of the changes in the layer's images with their drops.
  dose::DropBound drops_bound(const Layer& layer, std::uint64_t pixels) const {
    return plan_.images->dose.bound(sizes_of(layer, pixels, changes_of_images(plane(layer))));
  }
  /// The same before the dose.
  std::uint64_t edges_bound(const Layer& layer) const { return sizes_of(layer, 0, changes_of_images(plane(layer))).edges; }

 private:
  Nm plane(const Layer& layer) const { return plane_of(plan_.job, layer, plan_.scene->height); }
  Status section_of(const Solid& solid, const Layer& layer, ImageWork& work, Runs& image, LayerRecord& record,
                    ImageNotes& notes) const;
  raster::LayerReport section(const Solid& solid, raster::Engine engine, const Layer& layer, ImageWork& work,
                              Runs& image) const;
  Status position(const Layer& layer, const PlacedImages& part, ImageWork& work, std::uint64_t& filled) const;
  void mirror(Runs& image, Runs& scratch) const;
  Status check_grown(const Layer& layer, const ImageWork& work) const;
  std::uint64_t min_vanished() const;
  bool shares_voxels() const;  // of several materials or doses
  void cover(const Layer& layer, ImageWork& work) const;
  void add_shares(const Layer& layer, std::uint32_t part, ImageWork& work) const;
  void own_voxels(ImageWork& work) const;
  static void empty_removed(const Runs& before, bool deposited, ImageWork& work);
  std::array<Nm, 2> planes(const Layer& layer) const;
  void count(ImageWork& work, LayerRecord& record) const;
  dose::DropSizes sizes_of(const Layer& layer, std::uint64_t pixels, std::uint64_t of_images) const;
  std::uint64_t changes_of_images(Nm plane) const;
  std::uint64_t kept_changes(Nm plane) const;
  bool takes_bits() const;
  void merge_section(ImageWork& work) const;

  const Plan& plan_;
  bool keeps_bits_;
};

}  // namespace lamina::pipeline
