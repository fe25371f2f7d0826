// pipeline/run/layer_source.h: the layers of a powder job, without any file.
//
// For programs that embed lamina: the images are those of the files that run() would write.
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
#include "stages/write/image_format.h"

namespace lamina::pipeline {

/// A layer's image, and what of it is of each material.
struct PlannedImages {
  Runs whole;
  std::vector<Runs> material;  // in the order of materials(), no pixel set in two; empty where the whole is of one
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

  const Job& job() const;                // as asked
  std::array<double, 2> bed_mm() const;  // width (x) and depth (y)
  const PixelGrid& grid() const;
  const std::vector<PartSummary>& parts() const;
  /// Names of the powders, as file names have them; empty if no part names one.
  std::vector<std::string> materials() const;
  std::uint32_t layer_count() const;
  /// index  below layer_count()
  Layer layer(std::uint32_t index) const;

  /// The images of a layer. errors  kVerification: engine is kBoth and they differ
  /// memory  the runs; scratch is kept for the next layer, one set for each layer that is made at the same time
  Result<PlannedImages> images(std::uint32_t index) const;
  /// Closed contours of a layer, nm on the bed, outer ones counter-clockwise, as run() writes them for kContours.
  /// cost  the first call loads the parts once more
  Result<Contours> contours(std::uint32_t index) const;

 private:
  LayerSource();
  struct State;
  std::unique_ptr<State> state_;
};

/// The layers of a job, decided as `lamina heights` does: for parts alone, wherever they would stand. Of layers of each part
/// (heights.per_part) those of all parts by their tops.
/// errors  of check_job; kInput; kUsage: [heights] is not whole
Result<std::vector<Layer>> layers_of(const Job& job);

/// Reads the file of a part as the job asks for: its unit, its turns, repair. errors  kInput
Result<Part> load_part(const Job& job, const PartRequest& part);

/// Writes an image as run() would; the file appears whole. errors  kOutput
Status save_image(const std::string& path, const RunsView& image, double dpi_x, double dpi_y, const write::ImageFormat& format);

}  // namespace lamina::pipeline
