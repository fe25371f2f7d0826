// pipeline/check/verify.h: compares a directory, or a file of toolpaths, with its manifest.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/report/summary.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/replay/count.h"

namespace lamina::pipeline {

struct ToolpathCheck;  // pipeline/check/toolpaths.h

/// Of G-code files.
struct ToolpathOptions {
  std::string machine, material;   // of `lamina extrude`; empty: the recorded ones, or no rules of a machine
  std::vector<std::string> parts;  // folders or files of the parts of a file of lamina
  std::string model;               // the part of a file of any slicer; empty: not compared
  double filament_mm = 0;          // diameter; 0: the file's
};

struct VerifyOptions {
  bool quick = false;  // sizes and hashes only; images are not decoded
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;  // of layers in flight
  ToolpathOptions toolpaths;
};

/// Faults are in layer order, then stray files, then missing shards.
struct VerifyReport : Faults {
  std::string directory;
  std::uint64_t layers = 0;           // in the manifests
  std::uint64_t bytes = 0;            // of their files, as recorded
  std::string machine;                // whose programs were replayed; empty without programs
  std::uint64_t replayed = 0;         // layers
  replay::Count replay;               // sum over the replayed layers
  std::uint64_t moved = 0, lost = 0;  // pixels of blocked nozzles
  std::vector<UnfedPowder> unfed;     // by material, of a job with several and a machine
  replay::Material material;          // used up
  double coverage = 0;                // drops / pixels of the replayed layers
  std::shared_ptr<ToolpathCheck> toolpaths;  // of a replayed G-code file; else null
  bool recorded = true;                      // compared with a manifest
  Summary use;                        // what they use up and cost: lines, facts, table; empty without programs
};

/// Compares every file with the manifest of the whole job, or of all shards present: existence, size and hash. Unless
/// quick, it also decodes each image and compares columns, rows, resolution and number of set pixels, and replays each
/// layer's print program on a virtual machine, which must print that image bit for bit. Files in layers/ and program/
/// without an entry in a manifest are faults, and so are an interrupted job and shards that are missing. Layers that lamina
/// stream --consume has deleted are one fault together; the others are compared.
///
/// directory  or a file of toolpaths; toolpaths and contours are compared by the bytes of file and layers (compare_paths). G-code, with or
///            without a manifest, is replayed too (check/toolpaths.h), unless quick
/// errors  kVerification: manifest missing or unreadable; kUsage: no such directory or file; kMemory
/// cost    reads every file once, and again to decode it; parallel over layers; memory of a few layers' runs
Result<VerifyReport> verify(const std::string& directory, const VerifyOptions& options);

}  // namespace lamina::pipeline
