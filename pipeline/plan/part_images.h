// pipeline/plan/part_images.h: parts that are layer images.
#pragma once

#include <array>
#include <memory>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/arrange/placement.h"
#include "stages/data/status.h"
#include "stages/formats/images/layer_images.h"

namespace lamina::pipeline {

/// A part's images, opened, and what a manifest of lamina beside them and the job's keys say of them.
struct OpenImages {
  std::shared_ptr<const formats::LayerImages> images;
  std::array<std::int64_t, 2> dots{};  // an inch, or the bed's where they are the same
  Nm bottom = 0, thickness = 0;
  std::int64_t width = 0, depth = 0;  // nm on the bed
  std::vector<Note> notes;
};

/// errors  kInput, kUsage: what the files, the manifest and the keys do not tell together
Result<OpenImages> open_images(const Job& job, const PartRequest& part, const PixelGrid* grid);

/// The nearest whole pixel; told in a note if it is another place than asked.
PlacedImages placed_images(const OpenImages& open, const PartRequest& part, const PixelGrid& grid, std::int64_t x_nm,
                           std::int64_t y_nm, std::vector<Note>& notes);

/// The layers of a job of images alone are theirs; with meshes they are the job's. Sets job.layer_mm.
/// errors  kUsage: --layer or --heights or a filling that do not fit images
Status fit_layers(const Scene& scene, bool beads, Job& job);

}  // namespace lamina::pipeline
