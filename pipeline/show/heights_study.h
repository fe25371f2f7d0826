// pipeline/show/heights_study.h: what `lamina heights` finds out about a job's layers.
#pragma once

#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/heights/evaluate.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

/// One table and what it does to the surface.
struct HeightsStudy {
  std::string name;  // "optimal", "uniform 0.05 mm", "from table.txt"
  heights::Options options;
  std::vector<std::int64_t> boundaries;  // nm, one more than layers
  std::vector<LayerReason> reasons;      // of each layer; empty if the table is somebody else's
  heights::Plan plan;                    // its table is empty if somebody else's
  heights::Evaluation evaluation;
  double index_seconds = 0, plan_seconds = 0, evaluate_seconds = 0;  // wall
};

/// Decides and evaluates the layers of a job. errors  of heights_options and heights::plan_heights
Result<HeightsStudy> study_heights(const Job& job, const Scene& scene);

/// Evaluates layers that somebody else decided: tops in mm, one a line from the bottom up; "#" begins a comment.
/// errors  kInput, with the line
Result<HeightsStudy> study_table(const Job& job, const Scene& scene, const std::string& path);

/// The job's table beside all the other ways with the same thicknesses and limits, and uniform layers of the least and
/// of the greatest thickness.
Result<std::vector<HeightsStudy>> study_all_ways(const Job& job, const Scene& scene);

/// The one table of all parts, then the table that each part has of its own (heights/per_part.h).
Result<std::vector<HeightsStudy>> study_per_part(const Job& job, const Scene& scene);

}  // namespace lamina::pipeline
