// pipeline/run/extrude.h: a job from its parts to a file of toolpaths for an extrusion printer.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/flow/progress.h"
#include "pipeline/job/job.h"
#include "pipeline/machine/extruder.h"
#include "pipeline/plan/scene.h"
#include "pipeline/plan/segment.h"
#include "stages/data/status.h"
#include "stages/segment/moves.h"
#include "stages/write/extrusion_format.h"

namespace lamina::pipeline {

struct ExtrudeSummary {
  std::string output, machine;
  std::uint32_t layers = 0;
  std::uint64_t triangles = 0, points = 0, bytes_written = 0;
  double height_mm = 0;
  write::MoveTotals totals;
  double filament_cm3 = 0, filament_g = 0;
  segment::SegmentCounts segments;
  std::uint64_t first_layer_points = 0;  // segments.points() of the first layer
  segment::PlannedPorosity porosity;
  std::vector<std::pair<std::string, segment::Pores>> pores;  // by heights
  double load_seconds = 0, index_seconds = 0, layer_seconds = 0, plan_seconds = 0, write_seconds = 0;
  std::uint64_t peak_layer_bytes = 0, peak_resident_bytes = 0;
  std::uint32_t most_in_flight = 0;
  std::vector<PartSummary> parts;
  std::vector<std::string> warnings;
};

/// Writes job.output.
/// errors  of resolve_extruder, plan_segments and SlicePlan::make; kUsage: a part that is too high, layers that the
///         machine cannot lay; kOutput; kInterrupted: nothing is left behind
Result<ExtrudeSummary> run_extrude(const Job& asked, const ProgressCallback& progress, const std::atomic<bool>& cancel);

std::string extrude_summary_text(const Job& job, const ExtrudeSummary& summary);
std::string extrude_summary_json(const Job& job, const ExtrudeSummary& summary);

}  // namespace lamina::pipeline
