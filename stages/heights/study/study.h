// stages/heights/study/study.h: ways to decide layers, tried out: what each does to the surface.
#pragma once

#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/heights/evaluate.h"
#include "stages/heights/heights.h"

namespace lamina::heights {

/// One table and what it does to the surface.
struct Study {
  std::string name;  // "optimal", "uniform 0.05 mm", "from table.txt"
  Options options;
  std::vector<std::int64_t> boundaries;  // nm, one more than layers
  std::vector<LayerReason> reasons;      // of each layer; empty if the table is somebody else's
  Plan plan;                             // its table is empty if somebody else's
  Evaluation evaluation;
  double plan_seconds = 0, evaluate_seconds = 0;  // wall

  std::size_t layers() const { return boundaries.size() - 1; }
  /// nm, of a layer
  std::int64_t thickness(std::size_t layer) const { return boundaries[layer + 1] - boundaries[layer]; }
};

/// Decides and evaluates layers. errors and cost  of plan_heights and evaluate
Result<Study> study(const SurfaceIndex& index, const Options& options);

/// Evaluates layers that somebody else decided: tops in mm, one a line from the bottom up; "#" begins a comment.
/// errors  kInput: the file cannot be read, holds no layer, or a line is no height above the one before it; with the line
/// cost    of evaluate
Result<Study> study_table(const SurfaceIndex& index, const Options& options, const std::string& path);

/// All ways with the thicknesses and limits of `options`, and uniform layers of the least and of the greatest thickness.
/// errors and cost  of study, for each
Result<std::vector<Study>> study_all_ways(const SurfaceIndex& index, const Options& options);

/// The one optimal table of all parts, then the table that each part has of its own (per_part.h).
/// errors  of plan_per_part
Result<std::vector<Study>> study_per_part(SurfaceIndex index, Options options);

}  // namespace lamina::heights
