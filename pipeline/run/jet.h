// pipeline/run/jet.h: a binder-jet job from its parts to its directory of layer images.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/flow/progress.h"
#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct StageSeconds {
  double load = 0, index = 0, layers = 0;    // wall
  double raster = 0, encode = 0, write = 0;  // summed over threads, within layers
};

/// What a person or a script is told at the end; the numbers of --json.
struct JetSummary {
  std::string directory;
  std::uint32_t layers_total = 0, layers_planned = 0, layers_kept = 0;
  std::uint32_t columns = 0, rows = 0;
  std::uint64_t triangles = 0;  // with copies
  std::uint64_t set_pixels = 0, bytes_written = 0;
  std::vector<std::pair<std::string, std::uint64_t>> materials;  // name, set pixels; if there are several
  std::uint64_t moved_pixels = 0, lost_pixels = 0;               // of blocked nozzles: fired by another one, and not at all
  double set_volume_mm3 = 0;                                     // set pixels x pixel area x thickness
  std::uint64_t solid_pixels = 0, bead_pixels = 0;  // of the layers planned now: of parts, and of the beads in them
  std::uint64_t capped_rows = 0;                    // rows of all layers that are closed only thanks to repair
  std::uint64_t mesh_bytes = 0, index_bytes = 0, peak_layer_bytes = 0, peak_resident_bytes = 0;
  std::uint32_t most_layers_in_flight = 0;
  StageSeconds seconds;
  std::vector<PartSummary> parts;
  std::vector<std::string> warnings;  // one line each
};

/// Runs a job; writes job.output, unless it is a dry run, which ends before the first layer with the summary's
/// estimates. `cancel` is looked at between layers: when it is set, no new layer starts, the layers in flight are
/// finished and kept, and the error is kInterrupted.
/// errors  of load_scene; kOutput; kVerification if engine is kBoth and a pixel differs; the lowest failing layer decides
Result<JetSummary> run_jet(const Job& asked, const ProgressCallback& progress, const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
