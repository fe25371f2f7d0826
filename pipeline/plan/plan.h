// pipeline/plan/plan.h: a job with its parts loaded and all decisions common to its layers made.
//
//      Job (request) ──> resolve() ──> Resolved ──> make_plan() ──> Plan (const, any thread)
//
// Embedding programs make a plan and compute single layers; run() writes all layers to files.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/machine/materials.h"
#include "pipeline/machine/profiles.h"
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
#include "stages/heights/greedy.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

/// Data for images only.
struct ImagePlan {
  std::optional<ResolvedMachine> machine;  // absent: images alone
  PixelGrid grid;
  Materials materials;
  Solids solids;
  DosePlan dose;
  std::optional<Beads> beads;  // set if parts consist of beads
  bool geometry = false;       // layer images are those before the dose, which follows from them
};

/// Data for toolpaths only.
struct MovePlan {
  ExtruderProfile profile;
  std::uint32_t left_out = 0;  // layers whose middles are above their parts: nothing would be deposited
};

/// Scene, sections and segments keep their addresses when the plan moves, because other members refer to them.
struct Plan {
  Job job;  // as requested
  Product product = Product::kImages;
  Bed bed;
  std::unique_ptr<Scene> scene;
  heights::Plan heights;  // layer table of all parts; empty if each part has its own layers
  /// Decides the layers while others are made (Resolved::streams_layers); null if all are decided. Until then, layer_count and
  /// range are 0, and the table has the layers decided so far.
  std::unique_ptr<heights::GreedyLayers> undecided;
  std::uint32_t layer_count = 0;          // of the whole job
  std::array<std::uint32_t, 2> range{};   // [first, last) made by this job
  std::unique_ptr<Sections> sections;     // null for images of solid parts
  std::unique_ptr<SegmentPlan> segments;  // null for contours, and for images of solid parts
  std::optional<ImagePlan> images;
  std::optional<MovePlan> moves;
  std::vector<Warning> warnings;
  std::uint64_t triangles = 0;                                     // with copies
  double load_seconds = 0, index_seconds = 0;                      // wall
  double load_processor_seconds = 0, index_processor_seconds = 0;  // of all threads

  /// A layer as written and recorded.
  Layer layer(std::uint32_t index) const { return sections ? sections->layers()[index].layer : heights.table[index]; }
};

/// A job and its machine with the job's changes.
struct Resolved {
  Job job;  // as requested
  Product product = Product::kImages;
  Bed bed;
  std::optional<PowderPrinter> printer;     // of images
  std::optional<ExtruderProfile> extruder;  // of toolpaths
  /// Whether the caller takes layers while they are decided, where the job allows it: images without a program, of all layers,
  /// by a mode that decides one layer after the other. Files with a title state the number of layers first, and so do programs,
  /// slices and toolpaths; an inspection, a resumed run and a dry run need it first, too.
  bool streams_layers = false;
};

/// Loads no part and writes nothing. errors  kUsage: no such machine, keys that do not apply to the product
Result<Resolved> resolve(const Job& job, Product product);

/// The only way to make a plan.
/// errors  of load_scene and of the index builders; kUsage: parts outside the machine's reach, layers that it cannot
///         make, contradictory fillings
Result<Plan> make_plan(Resolved resolved, const ProgressCallback& progress);

}  // namespace lamina::pipeline
