// pipeline/output/image_files.h: writes the layers of a powder job: a file per image, the print program
// next to it, and the manifest.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "pipeline/output/directory.h"
#include "pipeline/output/job_container.h"
#include "pipeline/output/paged_job.h"
#include "pipeline/output/print_program.h"
#include "pipeline/plan/plan.h"
#include "stages/data/bit_image.h"
#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/formats/image_format.h"
#include "stages/support/io/sync.h"
#include "stages/support/io/temporary.h"

namespace lamina::pipeline {

/// The manifest head for a plan of images, and what the files of a layer say of it.
ManifestHead image_head(const Plan& plan);
formats::LayerTags tags_of(const Plan& plan, const Layer& layer);

/// The images of a layer that is to be written.
struct LayerImages {
  const Runs& whole;                     // of all materials, before its pixels get their drops
  std::span<const Runs> material;        // of each, where there are several
  std::span<const DropImageView> drops;  // of all materials, then of each; none if all get one drop a pixel
  const Levels& shares;                  // of the voxels, for formats that carry them; without drops
  const BitImage* bits = nullptr;        // in place of `whole`, of an image whose runs would take more memory
};

class ImageFiles {
 public:
  /// The plan must outlive this object.
  explicit ImageFiles(const Plan& plan);

  /// Before anything is written: layers before which vats are to be filled, in order.
  void pause_before(const std::vector<std::uint32_t>& layers) {
    if (program_) program_->refills = layers;
  }
  /// Prepares the directory and starts its manifest, if the number of layers is known: see start().
  /// errors  kUsage: the directory holds another job; kOutput
  Status open();
  /// Starts the manifest of a plan whose layers are decided since open(). errors  kOutput
  Status start();
  bool started() const { return manifest_.has_value() || finished_; }
  /// Layers still to be made, in increasing order; valid after opening.
  std::vector<std::uint32_t> take_todo() { return std::move(todo_); }
  /// Layers kept from an interrupted run.
  const std::vector<LayerRecord>& kept() const { return kept_; }
  const ManifestHead& head() const { return head_; }

  /// Scratch of a layer in flight; reused by later layers.
  struct FileWork {
    std::unique_ptr<formats::ImageEncoder> encoder;
    std::unique_ptr<formats::LevelEncoder> level_encoder;
    formats::Bytes file;
    std::vector<formats::Bytes> files;  // those that have names
    Levels levels;                      // drops of each pixel
    ProgramWork program;
    std::vector<std::uint32_t> sums;  // CRC-32 of the files and of the program, for a container
    std::uint64_t bytes() const;
  };

  // --- from many threads at once, each with its own work
  Status encode(const LayerImages& images, FileWork& work, LayerRecord& record) const;
  /// errors  kOutput; kUsage: the machine cannot feed the layer
  Status store(const LayerImages& images, FileWork& work, LayerRecord& record) const;
  /// The print program alone; of a dry run it is only timed.
  Status program(const LayerImages& images, FileWork& work, LayerRecord& record) const;
  /// Encodes images and program of a layer and drops them; their sizes go to the record. Of a dry run.
  Status measure(const LayerImages& images, FileWork& work, LayerRecord& record) const;
  /// Upper bound of the bytes for a layer whose images have that many changes. edges  those before the dose
  std::uint64_t bytes_bound(const dose::DropBound& drops, std::uint64_t edges) const;

  // --- from one thread at a time
  /// In layer order; kept layers are recorded in their place. work  of store(); needed by a container alone
  Status record(const LayerRecord& record, const FileWork& work);
  /// Whether record() needs the work.
  bool records_from_work() const { return in_container_ || in_pages_; }
  /// Whether the output is one file, with inspection.json in it.
  bool is_one_file() const { return in_container_; }
  /// The text of inspection.json, before the end of such a file.
  void set_inspection(std::string text) { inspection_ = std::move(text); }
  Status finish();
  /// Ends an interrupted or failed job; its finished layers stay recorded.
  Status keep();
  /// Removes the manifest and all layers of the directory; only of a whole job.
  void discard();

 private:
  /// The files of a layer as stored, and that of its program.
  template <class Visit>
  Status for_each_file(const LayerRecord& record, const FileWork& work, const Visit& visit) const;
  Status open_container();
  Status start_container();
  Status finish_container();
  Status open_pages();
  Status start_pages();
  /// Whether the pages, or offsets of the program, may exceed 4 GiB. The same for all runs of the job.
  bool needs_big_pages() const;
  Status take_kept(std::vector<LayerRecord> kept);
  void list_todo();
  Status record_kept_below(std::uint32_t layer);
  Result<std::vector<std::uint32_t>> feeds_of(const LayerRecord& record) const;
  void report_unfed(LayerRecord& record) const;
  Status program(const LayerImages& images, FileWork& work, LayerRecord& record, bool measures) const;
  Status encode_one(const LayerImages& images, std::size_t number, FileWork& work, const LayerRecord& record,
                    formats::Bytes& file) const;

  const Plan& plan_;
  ManifestHead head_;
  const formats::ImageFormat* format_;  // null if levels_ is there
  const formats::LevelFormat* levels_;
  std::optional<PrintProgram> program_;
  std::optional<Claim> claim_;  // until the manifest is started
  std::optional<ManifestWriter> manifest_;
  std::optional<FolderSync> sync_;
  bool in_container_, in_pages_;
  bool finished_ = false;  // of a container or of pages: nothing is to be written
  KeptContainer kept_container_;
  std::optional<JobContainer> container_;
  KeptPages kept_pages_;
  std::optional<PagedJob> pages_;
  std::string inspection_;
  std::vector<std::uint32_t> todo_;
  std::vector<LayerRecord> kept_;
  std::size_t next_kept_ = 0;
  MadeFolders made_;
};

}  // namespace lamina::pipeline
