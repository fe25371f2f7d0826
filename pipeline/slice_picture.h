// pipeline/slice_picture.h: one layer of a sliced job again, as shapes to look at.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/slice.h"
#include "stages/data/contours.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"

namespace lamina::pipeline {

/// Whether a directory's manifest.json is that of lamina slice.
bool is_slice_directory(const std::string& directory);

/// What pictures of a layer show.
struct LayerShapes {
  std::string title, caption;
  Box box;
  Layer layer{};
  Contours contours;
  struct Beads {
    PathKind kind;
    std::string name;
    Contours outline;  // all that the beads of this kind cover
  };
  std::vector<Beads> beads;  // in the order in which they are laid
};

/// The job that lamina slice left in a directory (job.toml), planned again from its parts.
class SlicePictures {
 public:
  /// errors  kUsage; kInput: a part that cannot be read
  static Result<SlicePictures> open(const std::string& directory);
  /// Of all layers, those that were sliced: [first, last).
  std::uint32_t first() const { return range_[0]; }
  std::uint32_t last() const { return range_[1]; }
  std::uint32_t count() const { return static_cast<std::uint32_t>(plan_.layers().size()); }
  /// errors  kUsage: no such layer; kVerification: a part that is not what it was
  Result<LayerShapes> layer(std::uint32_t index) const;

 private:
  SlicePictures(std::string directory, SlicePlan plan) : directory_(std::move(directory)), plan_(std::move(plan)) {}
  std::string directory_, manifest_;
  SlicePlan plan_;
  std::array<std::uint32_t, 2> range_{};
};

/// A drawing of the layer in its true size, bead widths true.
std::string shapes_svg(const LayerShapes& shapes);

}  // namespace lamina::pipeline
