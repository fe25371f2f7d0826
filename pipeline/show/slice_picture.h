// pipeline/show/slice_picture.h: one layer of a sliced job again, as shapes to look at.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>

#include "pipeline/output/manifest.h"
#include "pipeline/plan/plan.h"
#include "stages/data/status.h"
#include "stages/view/shapes.h"

namespace lamina::pipeline {

/// Whether a directory's manifest.json is that of lamina slice.
bool is_slice_directory(const std::string& directory);

/// The job that lamina slice left in a directory (job.toml), planned again from its parts.
class SlicePictures {
 public:
  /// errors  kUsage; kInput: a part that cannot be read
  static Result<SlicePictures> open(const std::string& directory);
  /// Of all layers, those that were sliced: [first, last).
  std::uint32_t first() const { return plan_.range[0]; }
  std::uint32_t last() const { return plan_.range[1]; }
  std::uint32_t count() const { return plan_.layer_count; }
  /// errors  kUsage: no such layer; kVerification: a part that is not what it was
  Result<view::LayerShapes> layer(std::uint32_t index) const;
  /// Of the first part.
  std::string name() const { return plan_.sections->names().empty() ? std::string() : plan_.sections->names().front(); }

 private:
  SlicePictures(std::string directory, Plan plan, Manifest manifest)
      : directory_(std::move(directory)), plan_(std::move(plan)), manifest_(std::move(manifest)) {}
  std::string directory_;
  Plan plan_;
  Manifest manifest_;
};

/// The same as a series. errors  of SlicePictures
Result<view::LayerSeries> slice_series(const std::string& directory);

}  // namespace lamina::pipeline
