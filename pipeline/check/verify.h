// pipeline/check/verify.h: is a directory, or a file of toolpaths, what its manifest says.
#pragma once

#include <cstdint>
#include <string>

#include "stages/data/status.h"
#include "stages/replay/count.h"

namespace lamina::pipeline {

struct VerifyOptions {
  bool quick = false;  // sizes and hashes only; images are not decoded
};

/// Faults are in layer order, then stray files.
struct VerifyReport : Faults {
  std::string directory;
  std::uint64_t layers = 0;           // that the manifests name
  std::uint64_t bytes = 0;            // of their files, as recorded
  std::string machine;                // whose programs were replayed; empty if there are none
  std::uint64_t replayed = 0;         // layers
  replay::Count replay;               // of all of them
  std::uint64_t moved = 0, lost = 0;  // pixels of blocked nozzles
  replay::Material material;          // used up
  double coverage = 0;                // drops / pixels of the layers replayed
};

/// Compares every file with the manifest (of the whole job, or of all shards that are there): present, of the recorded
/// size and hash, and, unless quick, an image of the recorded columns, rows, resolution and number of set pixels; and the
/// print program of each layer, carried out by a virtual machine, prints that image bit for bit. Files in
/// layers/ and program/ that no manifest names are faults, and so is a job that was interrupted.
///
/// directory  or a file of toolpaths: its bytes and those of each layer (compare_paths), as of contours
/// errors  kVerification if there is no manifest to compare with, or none that can be read; kUsage if there is no such
///         directory or file
/// cost    reads every file once, and once more to decode it; parallel over layers; memory of a few layers' runs
Result<VerifyReport> verify(const std::string& directory, const VerifyOptions& options);

}  // namespace lamina::pipeline
