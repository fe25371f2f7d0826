// pipeline/run/layer_source.h: the layers of a powder job in memory.
//
// For embedding programs: the images equal those in the files of run().
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/contours.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/formats/image_format.h"

namespace lamina::pipeline {

/// A layer's image, whole and per material.
struct PlannedImages {
  Runs whole;
  std::vector<Runs> material;  // in the order of materials(), disjoint; empty for a single material
};

/// Immutable; layers may be read in any order and from any number of threads.
class LayerSource {
 public:
  /// Loads and places the parts, decides the layers and builds the index. job.output is not read.
  /// errors  of check_job, resolve and make_plan
  static Result<LayerSource> make(const Job& job);
  LayerSource(LayerSource&&) noexcept;
  LayerSource& operator=(LayerSource&&) noexcept;
  ~LayerSource();

  const Job& job() const;                // as requested
  std::array<double, 2> bed_mm() const;  // width (x) and depth (y)
  const PixelGrid& grid() const;
  const std::vector<PartSummary>& parts() const;
  /// Names of the powders, as used in file names; empty if no part has one.
  std::vector<std::string> materials() const;
  std::uint32_t layer_count() const;
  /// index  below layer_count()
  Layer layer(std::uint32_t index) const;

  /// The images of a layer. errors  kVerification: engine is kBoth and the images differ
  /// memory  the runs; scratch is kept for later layers, one set per concurrent call
  Result<PlannedImages> images(std::uint32_t index) const;
  /// What run() has the files of a layer say, but for their material.
  formats::LayerTags tags(std::uint32_t index) const;
  /// Closed contours of a layer, nm on the bed, outer ones counter-clockwise, as run() writes them for kContours.
  /// cost  the first call loads the parts again
  Result<Contours> contours(std::uint32_t index) const;

 private:
  LayerSource();
  struct State;
  std::unique_ptr<State> state_;
};

/// The layers of a job, decided as by `lamina heights`: for the parts alone, wherever they stand. With heights.per_part those
/// of all parts, ordered by their tops. errors  of check_job; kInput; kUsage: [heights] is incomplete
Result<std::vector<Layer>> layers_of(const Job& job);

/// Loads a part's file with the job's options: unit, rotation, repair. errors  kInput
Result<Part> load_part(const Job& job, const PartRequest& part);

/// Writes an image in the same way as run(), atomically. errors  kOutput
Status save_image(const std::string& path, const RunsView& image, double dpi_x, double dpi_y,
                  const formats::ImageFormat& format, const formats::LayerTags& tags = {});

}  // namespace lamina::pipeline
