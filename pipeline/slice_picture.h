// pipeline/slice_picture.h: one layer of a sliced job again, as shapes to look at.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

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

/// Plans a layer of the job that lamina slice left in a directory (job.toml), from its parts; the middle layer if none is
/// given.
/// errors  kUsage: no such layer; kInput: a part that cannot be read; kVerification: a part that is not what it was
Result<LayerShapes> slice_shapes(const std::string& directory, std::optional<std::uint32_t> layer);

/// A drawing of the layer in its true size, bead widths true.
std::string shapes_svg(const LayerShapes& shapes);

}  // namespace lamina::pipeline
