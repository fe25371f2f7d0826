// pipeline/manifest/manifest.h: the manifest of a finished job, in one form for all products.
//
// A manifest is JSON with one line per layer, in layer order. It is identical for all runs of a job: it holds no times of a
// run, thread counts, engine or host. While a job runs it grows as NAME.json.part, so that an interrupted job can resume from
// the complete lines; it gets its final name after the last layer.
//
//   images        DIR/manifest.json, or DIR/manifest-2-of-5.json of a shard
//   contours      DIR/manifest.json
//   toolpaths     part.gcode.json next to part.gcode
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/manifest/record.h"
#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/temporary.h"

namespace lamina {

class FileReader;

/// Version of the manifest's lines and keys; readers refuse others.
inline constexpr int kManifestVersion = 2;

/// The head of the manifest: the resolved job and everything else that decides bytes.
struct ManifestHead {
  Product product = Product::kImages;
  std::string version;                            // of lamina
  std::string job_toml;                           // the resolved job, only keys that decide bytes of this product
  std::string format;                             // of the files: an image format, svg, cli, ..., gcode, sml
  std::string extension;                          // of a layer's file, with the dot; empty without per-layer files
  std::string file;                               // single file of all layers, next to the manifest; empty if none
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
  std::uint32_t max_drops = 0;             // of a pixel; 0: no saturation was requested, and set pixels get one

  bool geometry = false;  // images are those before the dose, by which the job makes the drops of each (check/expected_drops.h)
  std::uint32_t levels = 0;  // of shares of voxels; 0: pixels are set or not
  /// That a nozzle can fire on a pixel in one sweep, and does at the scan's speed.
  std::uint32_t head_drops = 1, sweep_drops = 1;

  /// Whether the drops of a pixel are the level of a grey image, the only one of its layer.
  bool grey_drops() const;
  /// The darkest level of images that carry levels: of a full voxel, or of grey_level_of(max_drops) drops; 0: images of one
  /// bit.
  std::uint8_t full_level() const;

  /// What a pixel has at most: drops, or levels of a full voxel; 1: it is set or not.
  std::uint8_t max_of_pixel() const;

  /// Images of a material in a layer: one a drop of a pixel, if there can be several and the images are of one bit.
  std::uint32_t drop_images() const { return max_drops > 1 && !grey_drops() && !geometry ? max_drops : 1; }
  /// Images of a layer that have names and records of their own: those of the first material, of the next, ... 0: the one
  /// image that the layer's own record is of.
  std::size_t named_images() const {
    const std::size_t drops = drop_images();
    return !materials.empty() ? materials.size() * drops : drops > 1 ? drops : 0;
  }
  /// bronze, drop2, or bronze-drop2
  std::string image_name(std::size_t number) const;
  /// Whether a pixel can get several drops, of several materials: its images do not say alone what the layer's record does.
  bool drops_of_materials() const { return max_drops > 1 && !materials.empty(); }

  /// Hash of all fields above except the range: manifests of the same job have equal ids.
  Hash128 id() const;
};

/// The darkest level of grey images of so many drops: 1, 3, 15 or 255, that of as many bits.
std::uint8_t grey_level_of(std::uint32_t max_drops);

/// "bracket.stl and 2 more"; empty without parts.
std::string title_of(const std::vector<PartSummary>& parts);

/// Whether heads are of one job, regardless of their ranges.
bool same_job(const ManifestHead& one, const ManifestHead& other);

/// The first difference between heads of different jobs, "bed.dpi is [600, 600], was [1200, 1200]"; empty for one job.
std::string difference(const ManifestHead& now, const ManifestHead& earlier);

struct Manifest {
  ManifestHead head;
  std::vector<LayerRecord> layers;  // in layer order
  bool complete = false;            // read from a finished .json, not from a .part
  FileDigest file;                  // single file of all layers; set if it exists and the manifest is complete
};

/// The name of a layer's file in the job's directory, layers/000042.tif, or layers/000042-bronze.tif and
/// layers/000042-drop2.tif of a job with several images a layer; empty for a format without files.
std::string layer_file_name(std::uint32_t index, std::string_view extension, std::string_view image = {});

/// An image of a layer, as listed in the manifest.
struct LayerImageFile {
  std::string name;  // in the job's directory; empty for a format without files
  ImageRecord record;
};
/// All images of a layer: one, or one per material in the order of the manifest, or one per drop: drop k is the image of the
/// pixels that get at least k. Of grey drops one.
std::vector<LayerImageFile> layer_images(const ManifestHead& head, const LayerRecord& record);

/// Reads a manifest, or the complete lines of a .part.
/// errors  kVerification with file and line
Result<Manifest> read_manifest(const std::string& path);
Result<Manifest> read_manifest(FileReader& file);

/// The head alone. errors  of read_manifest
Result<ManifestHead> read_manifest_head(const std::string& path);

/// Whether a file has a complete head; the .part of a run killed early may lack it.
bool has_manifest_head(const std::string& path);

/// Whether a job is on record: its finished manifest is there, or the begun one with its head. path  of the finished one
bool has_record(const std::string& path);

/// Whether NAME.part may be replaced as the begun manifest of a run, however torn. errors  kUsage: it is somebody else's
Status check_begun_manifest(const std::string& part);

/// The product of a manifest, from its first lines; nothing if the file is absent or not a manifest of this version.
std::optional<Product> product_of_manifest(const std::string& path);

/// The record of layer images by the manifest next to them.
struct ImagesOnRecord {
  std::string path;              // of the images
  Nm bottom = 0, thickness = 0;  // of the first layer, of all; 0: nothing is on record
  std::string mirror;            // of the job that wrote them
  std::uint32_t levels = 0;      // of shares of voxels, that they carry; 0: they are of 1 bit
  bool geometry = false;         // they are those before the dose of their job
};

/// path  a job's directory, its layers/, or anything else, of which nothing is on record
/// errors  kInput: several images a layer, or layers of several thicknesses
Result<ImagesOnRecord> images_on_record(const std::string& path);

/// The path of the manifest of a layer, DIR/layers/000042.tif, of whose directories the last one may be in a container.
std::string manifest_of_layer(const std::string& image);

/// Whether an image is a layer of a job whose manifest says that its grey is drops of a pixel. False where none says so.
bool are_grey_drops(const std::string& image);

/// Appends layers in order; thread-compatible (the flow records one layer at a time).
class ManifestWriter {
 public:
  struct ManifestOptions {
    Sync sync = Sync::kJob;
    bool sync_head = true;  // before the record has its name; false if the folder is synced at once, and nothing is replaced
    /// With Sync::kLayer: makes what the next lines record survive a power cut, before they are written.
    std::function<Status()> sync_layers = {};
  };

  /// Starts `path`.part with the head and a resumed job's kept first records. It replaces an earlier .part atomically, so
  /// that a kill at any moment loses no kept record.
  /// claim   of `path`; none: it is taken here
  /// errors  kOutput: cannot be written, or another run is writing it
  static Result<ManifestWriter> open(const std::string& path, const ManifestHead& head,
                                     const std::vector<LayerRecord>& kept_prefix, ManifestOptions options,
                                     std::optional<Claim> claim = {});
  static Result<ManifestWriter> open(const std::string& path, const ManifestHead& head,
                                     const std::vector<LayerRecord>& kept_prefix) {
    return open(path, head, kept_prefix, ManifestOptions());
  }
  ManifestWriter(ManifestWriter&&) noexcept;
  ManifestWriter& operator=(ManifestWriter&&) noexcept;
  ~ManifestWriter();

  /// The line is in the file when this returns: a kill loses no layer that is on record.
  Status append(const LayerRecord& record);
  /// Flushes the buffer, for an interrupted job.
  Status flush();
  /// Closes the JSON and gives it its final name.
  /// file   the single file of all layers, if any
  /// names  once all that needs space is written, before the name is taken: removes what an earlier job left, gives the
  ///        other files their names. After a failure or a kill in it the record of all layers stands as `path`.part
  Status finish(const FileDigest& file = {}, const std::function<Status()>& names = {});
  /// Closes the JSON in `path`.part, of which `take` keeps a copy elsewhere; then removes it. After a failure or a kill in
  /// it the record of all layers is there still.
  Status finish_elsewhere(const std::function<Status()>& take);
  /// Removes the started file.
  void discard();

 private:
  ManifestWriter();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina
