// pipeline/run/layer_workshop.h: one layer of a binder-jet job, from its section to its files.
#pragma once

#include <atomic>
#include <cstdint>

#include "pipeline/flow/graph.h"
#include "pipeline/job/job.h"
#include "pipeline/machine/materials.h"
#include "pipeline/output/manifest.h"
#include "pipeline/output/print_program.h"
#include "pipeline/plan/dose.h"
#include "pipeline/plan/porous_plan.h"
#include "pipeline/plan/solids.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {

struct StageSums {
  std::atomic<std::int64_t> raster{0}, encode{0}, write{0};  // ns, over all threads
};

/// A job while its layers are in flight: what the graph calls for each of them. What it is made from has to outlive it.
class LayerWorkshop {
 public:
  /// program         or nullptr
  /// porous          or nullptr: parts are solid
  /// covered_pixels  by the boxes of all parts, at most
  LayerWorkshop(const Job& job, const Solids& solids, const Materials& materials, const ManifestHead& head,
                const write::ImageFormat& format, const PrintProgram* program, const PorousPlan* porous,
                std::uint64_t covered_pixels);

  // The steps of a layer; from many threads at once, each with work of its own.
  /// The image of a layer, and those of its materials. errors  kVerification: engines disagree
  Status raster(LayerWork& work, LayerOutcome& outcome);
  Status encode(LayerWork& work, LayerOutcome& outcome);
  /// errors  kOutput; kUsage: the machine cannot feed the layer
  Status store(LayerWork& work, LayerOutcome& outcome);

  /// Scratch, runs and files of a layer, at most; a mirrored or second image counts as another one.
  std::uint64_t bytes_of_layer(const Layer& layer) const;

  StageSums sums;

 private:
  Status section_of(const Solid& solid, LayerWork& work, Runs& image, LayerOutcome& outcome);
  raster::LayerReport section(const Solid& solid, raster::Engine engine, const Layer& layer, LayerWork& work, Runs& image);
  void mirror(Runs& image, Runs& scratch) const;
  Status encode_image(LayerWork& work, const LayerRecord& record, const RunsView& image, write::Bytes& file) const;
  /// bead_changes  that a filling adds to an image
  std::uint64_t bytes_of_section(Nm plane, std::uint64_t bead_changes) const;

  const Job& job_;
  const Solids& solids_;
  const Materials& materials_;
  const ManifestHead& head_;
  const write::ImageFormat& format_;
  const PrintProgram* program_;
  const PorousPlan* porous_;
  DosePlan dose_;
  std::uint64_t covered_pixels_;
};

}  // namespace lamina::pipeline
