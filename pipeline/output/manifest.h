// pipeline/output/manifest.h: what a finished directory says of itself.
//
// manifest.json is JSON with one line a layer, in layer order. It holds nothing that differs between two runs of the
// same job: no times, no thread counts, no engine, no host. While a job runs it grows as manifest.json.part, so that an
// interrupted job can be resumed from the lines that are whole; it gets its final name when the last layer is in.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/machine/materials.h"
#include "pipeline/plan/scene.h"
#include "stages/data/hash.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// What a layer's line says of its print program, for a job with a machine.
struct ProgramRecord {
  std::uint64_t bytes = 0;
  Hash128 hash;
  std::uint32_t sweeps = 0;  // that fire
  std::uint64_t drops = 0;
  std::uint64_t moved = 0, lost = 0;  // pixels of blocked nozzles (stages/program/compile.h)
};

/// What a layer's line says of its image of one material, where a job has several.
struct ImageRecord {
  std::uint64_t bytes = 0, set_pixels = 0;
  Hash128 hash;
};

/// One line of the manifest.
struct LayerRecord {
  Layer layer;
  std::uint64_t bytes = 0;  // of the file; 0 for the null format; of all of a layer's images
  std::uint64_t set_pixels = 0;
  std::uint32_t capped_rows = 0;    // rows that are closed only thanks to repair (load/repair.h)
  Hash128 hash;                     // of the file; nothing where there are several
  ProgramRecord program;            // zeros without a machine
  std::vector<ImageRecord> images;  // one for each material, if the job has several
};

/// The head of the manifest: the job as resolved and all that decides bytes.
struct ManifestHead {
  std::string version;    // of lamina
  std::string job_toml;   // the resolved job, only keys that decide bytes
  std::string format;     // id of the image format
  std::string extension;  // of its files, with the dot
  std::string fill_rule, mirror;
  PixelGrid grid;
  std::uint32_t layer_count = 0;                  // of the whole job
  std::uint32_t first_layer = 0, last_layer = 0;  // the range [first, last) that this manifest covers
  std::vector<PartSummary> parts;
  std::string machine, dialect, program_extension;  // empty without a machine
  Hash128 machine_profile;                          // of program/machine.toml
  Hash128 program_start, program_end;               // of program/start.* and end.*
  std::vector<JobMaterial> materials;               // if there are several
  /// Hash of all of the above but the range: two directories with the same id belong to the same job.
  Hash128 id() const;
};

/// The head of a job whose parts are loaded. `layers` [first, last) as layer_range() gives it.
ManifestHead make_head(const Job& job, const std::vector<PartSummary>& parts, std::uint32_t layer_count,
                       std::array<std::uint32_t, 2> layers, const Materials& materials = {});

/// What keeps two heads from belonging to the same job, as "bed.dpi is [600, 600], was [1200, 1200]"; empty if nothing.
std::string difference(const ManifestHead& now, const ManifestHead& earlier);

struct Manifest {
  ManifestHead head;
  std::vector<LayerRecord> layers;  // in layer order
  bool complete = false;            // read from a .json that was closed, not from a .part
};

/// Name of the manifest in a job's directory: manifest.json, or manifest-<i>-of-<n>.json for a shard.
std::string manifest_name(const Job& job);
/// The name of a layer's file in the job's directory, layers/000042.tif, or layers/000042-bronze.tif of a job with several
/// materials; empty for a format without files.
std::string layer_file_name(std::uint32_t index, std::string_view extension, std::string_view material = {});

/// An image of a layer, as the manifest has it.
struct LayerImageFile {
  std::string name;  // in the job's directory; empty for a format without files
  ImageRecord record;
};
/// All images of a layer: one, or one for each material in the order of the manifest.
std::vector<LayerImageFile> layer_images(const ManifestHead& head, const LayerRecord& record);

/// Reads a manifest, or as many whole lines as a .part holds. errors: kVerification with file and line
Result<Manifest> read_manifest(const std::string& path);

/// Refuses a manifest that another run is writing right now: two runs in one directory would tear each other's files.
/// errors  kOutput
Status check_not_being_written(const std::string& path);

/// Appends layers in order; thread-compatible (the graph's ordered writer is serial).
class ManifestWriter {
 public:
  /// Starts `path`.part with the head and the records that a resumed job keeps from its start. An earlier .part is
  /// replaced at once, so that a kill at any moment loses no record that is kept.
  /// errors  kOutput: cannot be written, or another run is writing it right now
  static Result<ManifestWriter> open(const std::string& path, const ManifestHead& head, std::vector<LayerRecord> kept_prefix);
  ManifestWriter(ManifestWriter&&) noexcept;
  ManifestWriter& operator=(ManifestWriter&&) noexcept;
  ~ManifestWriter();

  /// Buffers the line; the file gets it within a second or 64 lines, whichever is first.
  Status append(const LayerRecord& record);
  /// Writes out what is buffered: for an interrupted job.
  Status flush();
  /// Closes the JSON and gives it its final name.
  Status finish();

 private:
  ManifestWriter();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::pipeline
