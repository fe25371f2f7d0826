// pipeline/show/report_source.h: the input of a report on a finished job: its manifest, the runs of its layers, and its parts.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/scene.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/geometry/bits.h"
#include "stages/view/cast.h"

namespace lamina::pipeline {

struct ReportLayer {
  Runs runs;                                  // all materials as one image; toolpaths as the area of their beads
  double seconds = 0;                         // estimated machine time; 0 without a machine
  std::shared_ptr<const BitImage> bits = {};  // in place of runs that would take more memory

  RowRuns rows() const { return bits ? RowRuns(*bits) : RowRuns(runs); }
};

struct ReportSource {
  std::string manifest_path;
  Manifest manifest;
  PixelGrid grid;                  // of the layers' runs
  Box box;                         // of toolpaths: nm of the machine, of all beads; the grid begins at its corner
  std::optional<Machine> machine;  // that the job's programs are for
  /// A layer, by its place in the manifest; for any thread. timed: with the machine's seconds
  /// errors  kVerification: a file that is missing or differs from the manifest, a program that prints a different image
  std::function<Result<ReportLayer>(std::uint32_t position, bool timed)> layer;
  /// Memory that such a layer takes at most.
  std::function<std::uint64_t(std::uint32_t position, bool timed)> bytes = [](std::uint32_t, bool) { return std::uint64_t{0}; };
};

/// path  a directory of lamina jet, or a G-code file of lamina extrude with its manifest next to it
/// errors  kVerification: no manifest, an unfinished job, a job of contours, a job without images, a changed G-code file;
///         of the readers
Result<ReportSource> report_source(const std::string& path);

/// The job's parts where they stand.
///
/// A manifest names parts without their folders. Each is searched in `folders` (entries may also be files) and accepted if
/// its triangles match the recorded fingerprint. errors  kInput: a missing or changed part, with its name; of load_scene
Result<Scene> find_parts(const ManifestHead& head, const Job& job, const Machine* machine,
                         const std::vector<std::string>& folders);

/// Parts from above, from the front and from the right, `most` pixels along the longest side of all.
Result<std::array<view::Picture, 3>> cast_parts(const Scene& scene, std::uint32_t maximum);

}  // namespace lamina::pipeline
