// pipeline/show/report_source.h: what a report on a finished job reads: its manifest, and what its layers look like.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

struct LayerSeen {
  Runs runs;           // several materials are drawn as one; toolpaths as what their beads cover
  double seconds = 0;  // of the machine, estimated, if there is one
};

struct ReportSource {
  std::string manifest_path;
  Manifest manifest;
  PixelGrid grid;  // of the layers' runs
  /// A layer, by its place in the manifest; for any thread. timed: with the machine's seconds
  /// errors  kVerification: a file that is missing or not what the manifest says, a program that prints something else
  std::function<Result<LayerSeen>(std::uint32_t place, bool timed)> layer;
};

/// path  a directory of lamina jet, or a G-code file of lamina extrude with its manifest beside it
/// errors  kVerification: no manifest, a job that is not finished, one of contours, one without images, a G-code file that has
///         changed; of the readers
Result<ReportSource> report_source(const std::string& path);

}  // namespace lamina::pipeline
