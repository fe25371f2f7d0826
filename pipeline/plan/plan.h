// pipeline/plan/plan.h: a job with its parts loaded and everything decided that its layers share.
//
//      Job (asked) ──> resolve() ──> Resolved ──> make_plan() ──> Plan (const, any thread)
//
// Programs that embed lamina make a plan and ask it for layers; run() sends all of them to files.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/machine/extruder.h"
#include "pipeline/machine/materials.h"
#include "pipeline/machine/powder_printer.h"
#include "pipeline/plan/beads.h"
#include "pipeline/plan/dose.h"
#include "pipeline/plan/progress.h"
#include "pipeline/plan/scene.h"
#include "pipeline/plan/sections.h"
#include "pipeline/plan/segment.h"
#include "pipeline/plan/solids.h"
#include "stages/data/choices.h"
#include "stages/data/extruder.h"
#include "stages/data/grid.h"
#include "stages/data/status.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

/// What only images need.
struct ImagePlan {
  std::optional<ResolvedMachine> machine;  // absent: images alone
  PixelGrid grid;
  Materials materials;
  Solids solids;
  DosePlan dose;
  std::optional<Beads> beads;        // where parts are beads instead of solid
  std::uint64_t covered_pixels = 0;  // of the bed, by the boxes of all parts, at most
};

/// What only toolpaths need.
struct MovePlan {
  ExtruderProfile profile;
  std::vector<std::pair<std::string, segment::Pores>> pores;  // by heights, "" for all
};

/// Scene, sections and segments stay where they are when the plan moves: others refer to them.
struct Plan {
  Job job;  // as asked
  Product product = Product::kImages;
  Bed bed;
  std::unique_ptr<Scene> scene;
  heights::Plan heights;                  // the one table of all parts; empty where each has layers of its own
  std::uint32_t layer_count = 0;          // of the whole job
  std::array<std::uint32_t, 2> range{};   // [first, last) that this job makes
  std::unique_ptr<Sections> sections;     // null for images of solid parts
  std::unique_ptr<SegmentPlan> segments;  // null for contours, and for images of solid parts
  std::optional<ImagePlan> images;
  std::optional<MovePlan> moves;
  std::vector<std::string> warnings;
  std::uint64_t triangles = 0;  // with copies
  double load_seconds = 0, index_seconds = 0;

  /// A layer as it is written and recorded.
  Layer layer(std::uint32_t index) const { return sections ? sections->layers()[index].layer : heights.table[index]; }
};

/// A job with its machine found and changed as the job says.
struct Resolved {
  Job job;  // as asked
  Product product = Product::kImages;
  Bed bed;
  std::optional<PowderPrinter> printer;     // of images
  std::optional<ExtruderProfile> extruder;  // of toolpaths
};

/// Nothing is loaded, nothing is written. errors  kUsage: no such machine, keys that have no meaning for the product
Result<Resolved> resolve(const Job& job, Product product);

/// The only way to a plan.
/// errors  of load_scene, of the stages that build indices; kUsage: parts that the machine cannot reach, layers that it
///         cannot make, fillings that contradict each other
Result<Plan> make_plan(Resolved resolved, const ProgressCallback& progress);

}  // namespace lamina::pipeline
