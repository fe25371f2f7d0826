// stages/heights/study/study.h: compares layer tables by their effect on the surface.
#pragma once

#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/heights/evaluate.h"
#include "stages/heights/heights.h"

namespace lamina::heights {

/// One layer table and its effect on the surface.
struct Study {
  std::string name;  // "optimal", "uniform 0.05 mm", "from table.txt"
  Options options;
  std::vector<std::int64_t> boundaries;  // nm, one more than layers
  std::vector<LayerReason> reasons;      // of each layer; empty for a given table
  Plan plan;                             // its table is empty for a given one
  Evaluation evaluation;
  double plan_seconds = 0, evaluate_seconds = 0;  // wall

  std::size_t layers() const { return boundaries.size() - 1; }
  /// nm, of a layer
  std::int64_t thickness(std::size_t layer) const { return boundaries[layer + 1] - boundaries[layer]; }
};

/// Decides and evaluates layers. errors and cost  of plan_heights and evaluate
Result<Study> study(const SurfaceIndex& index, const Options& options);

/// Evaluates a given table from a file: tops in mm, one per line from the bottom up; "#" begins a comment.
/// errors  kInput, with the line: the file is unreadable or without layers, or a line is not a height above the previous
/// cost    of evaluate
Result<Study> study_table(const SurfaceIndex& index, const Options& options, const std::string& path);

/// All modes with the thicknesses and limits of `options`, and uniform layers of the least and the greatest thickness.
/// errors and cost  of study, for each
Result<std::vector<Study>> study_all_modes(const SurfaceIndex& index, const Options& options);

/// The optimal table of all parts together, then the table of each part (per_part.h).
/// errors  of plan_per_part
Result<std::vector<Study>> study_per_part(SurfaceIndex index, Options options);

}  // namespace lamina::heights
