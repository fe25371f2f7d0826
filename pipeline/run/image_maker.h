// pipeline/run/image_maker.h: the layers of a powder job: exact images, one for each material, and what fires them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pipeline/output/image_files.h"
#include "pipeline/plan/plan.h"
#include "pipeline/run/maker.h"
#include "stages/data/runs.h"
#include "stages/raster/materials.h"
#include "stages/raster/raster.h"

namespace lamina::pipeline {

/// What the images of a layer occupy while they are made; reused by later layers.
struct ImageWork {
  raster::LayerScratch scratch;
  Runs runs;             // the image of all materials
  Runs second;           // of the other engine, or mirrored, or before its dose
  Runs third;            // the core of a layer with a shell
  Runs lowest, highest;  // sections at both ends of the layer, where steps have to lie inside or outside
  Runs section;          // of one solid of a layer with several materials
  raster::MaterialImages materials;
  std::unique_ptr<BeadWork> beads;  // where beads fill parts

  /// Of its buffers.
  std::uint64_t bytes() const;
};

/// What is noticed about a layer while it is made.
struct ImageNotes {
  raster::LayerReport report;
  std::uint64_t solid_pixels = 0, bead_pixels = 0;  // of parts, and what beads and shells leave of them
};

/// The steps of a layer's images; const, any thread, each with work of its own.
class LayerImager {
 public:
  /// The plan has to outlive it.
  explicit LayerImager(const Plan& plan) : plan_(plan) {}

  // --- in this order; contours, fill and beads only where beads fill the parts
  /// errors  kVerification: engines disagree
  Status raster(const Layer& layer, ImageWork& work, LayerRecord& record, ImageNotes& notes) const;
  Status contours(const Layer& layer, ImageWork& work) const;
  Status fill(const Layer& layer, ImageWork& work) const;
  Status beads(const Layer& layer, ImageWork& work, ImageNotes& notes) const;
  /// Mirrors, takes bleed and core away, and counts what is left.
  void dose(const Layer& layer, ImageWork& work, LayerRecord& record) const;
  /// All of them.
  Status make(const Layer& layer, ImageWork& work, LayerRecord& record, ImageNotes& notes) const;

  /// Scratch and runs of a layer, at most; a mirrored or second image counts as another one.
  std::uint64_t bytes_of(const Layer& layer) const;
  /// Changes that the layer's image may have.
  std::uint64_t changes_bound(const Layer& layer) const;

 private:
  Status section_of(const Solid& solid, const Layer& layer, ImageWork& work, Runs& image, LayerRecord& record,
                    ImageNotes& notes) const;
  raster::LayerReport section(const Solid& solid, raster::Engine engine, const Layer& layer, ImageWork& work,
                              Runs& image) const;
  void mirror(Runs& image, Runs& scratch) const;
  std::uint64_t bytes_of_section(Nm plane, std::uint64_t changes) const;
  std::uint64_t changes_of_section(Nm plane, std::uint64_t bead_changes) const;

  const Plan& plan_;
};

/// The head of the summary of a plan of images.
void tell_images(const Plan& plan, Summary& summary);

std::unique_ptr<Maker> make_image_maker(const Plan& plan, const FlowLimits& limits);

}  // namespace lamina::pipeline
