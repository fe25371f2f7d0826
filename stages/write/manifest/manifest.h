// stages/write/manifest/manifest.h: what a finished job says of itself; every product leaves one of this kind.
//
// A manifest is JSON with one line a layer, in layer order. It holds nothing that differs between two runs of the same
// job: no times, no thread counts, no engine, no host. While a job runs it grows as NAME.json.part, so that an
// interrupted job can be resumed from the lines that are whole; it gets its final name when the last layer is in.
//
//   images        DIR/manifest.json, or DIR/manifest-2-of-5.json of a shard
//   contours      DIR/manifest.json
//   toolpaths     part.gcode.json beside part.gcode
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/hash.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/write/manifest/record.h"

namespace lamina {

/// Of the lines and keys of a manifest; readers refuse others.
inline constexpr int kManifestVersion = 2;

/// The head of the manifest: the job as resolved and all that decides bytes.
struct ManifestHead {
  Product product = Product::kImages;
  std::string version;                            // of lamina
  std::string job_toml;                           // the resolved job, only keys that decide bytes of this product
  std::string format;                             // of the files: an image format, svg, cli, ..., gcode, sml
  std::string extension;                          // of a layer's file, with the dot; empty if no layer has a file of its own
  std::string file;                               // the one file of all layers, beside the manifest; empty if there is none
  std::uint32_t layer_count = 0;                  // of the whole job
  std::uint32_t first_layer = 0, last_layer = 0;  // the range [first, last) that this manifest covers
  std::vector<PartSummary> parts;
  std::string machine;  // empty without one
  Hash128 machine_profile;

  // --- images
  std::string fill_rule, mirror;
  PixelGrid grid;
  std::string dialect, program_extension;  // of the print programs; empty without a machine
  Hash128 program_start, program_end;      // of program/start.* and end.*
  std::vector<JobMaterial> materials;      // if there are several

  /// Hash of all of the above but the range: two manifests with the same id belong to the same job.
  Hash128 id() const;
};

/// "bracket.stl and 2 more"; empty without parts.
std::string title_of(const std::vector<PartSummary>& parts);

/// What keeps two heads from belonging to the same job, as "bed.dpi is [600, 600], was [1200, 1200]"; empty if nothing.
std::string difference(const ManifestHead& now, const ManifestHead& earlier);

struct Manifest {
  ManifestHead head;
  std::vector<LayerRecord> layers;  // in layer order
  bool complete = false;            // read from a .json that was closed, not from a .part
  FileDigest file;                  // the one file of all layers, if there is one and the manifest is complete
};

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

/// Reads a manifest, or as many whole lines as a .part holds.
/// errors  kVerification with file and line; a manifest of an earlier version of lamina says so
Result<Manifest> read_manifest(const std::string& path);

/// Whether a file has all that stands before its first layer: the .part of a run that was killed at once may not.
bool has_manifest_head(const std::string& path);

/// The product of a manifest, from its first lines; nothing if the file is absent or no manifest of this version.
std::optional<Product> product_of_manifest(const std::string& path);

/// Appends layers in order; thread-compatible (the flow records one layer at a time).
class ManifestWriter {
 public:
  /// Starts `path`.part with the head and the records that a resumed job keeps from its start. An earlier .part is
  /// replaced at once, so that a kill at any moment loses no record that is kept.
  /// errors  kOutput: cannot be written, or another run is writing it right now
  static Result<ManifestWriter> open(const std::string& path, const ManifestHead& head,
                                     const std::vector<LayerRecord>& kept_prefix);
  ManifestWriter(ManifestWriter&&) noexcept;
  ManifestWriter& operator=(ManifestWriter&&) noexcept;
  ~ManifestWriter();

  /// Buffers the line; the file gets it within a second or 64 lines, whichever is first.
  Status append(const LayerRecord& record);
  /// Writes out what is buffered: for an interrupted job.
  Status flush();
  /// Closes the JSON and gives it its final name. file  the one file of all layers, if there is one
  Status finish(const FileDigest& file = {});
  /// Removes what was begun.
  void discard();

 private:
  ManifestWriter();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina
