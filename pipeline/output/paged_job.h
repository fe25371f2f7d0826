// pipeline/output/paged_job.h: a powder job whose layers are the pages of one TIFF file (--container tiff), written in the
// order of layers.
//
//   DIR/layers.tif, program.EXT, machine.toml      see stages/support/io/paged.h
//   DIR/manifest.json, inspection.json             as of a job in folders
// While it runs, layers.tif, program.EXT and manifest.json have .part; of a layer they grow in this order. The same job gives
// the same bytes, however often it was interrupted.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/output/print_program.h"
#include "stages/data/status.h"
#include "stages/formats/tiff/pages.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"

namespace lamina::pipeline {

/// Checks that a directory has no files of another kind of job, folders of layers or pages, which this one would mix with its
/// own. Changes nothing. errors  kUsage
Status check_kind_of_output(const Job& job);

/// Claims the directory; with --overwrite, removes the output of an earlier job.
/// errors  kUsage, kOutput, of claim_output
Result<Claim> claim_paged_output(const Job& job, MadeFolders& made);

/// What a job that is to be resumed has in its directory.
struct KeptPages {
  std::vector<LayerRecord> layers;  // from the first on
  std::optional<JobPage> last;      // of those layers
  std::uint64_t program_end = 0;    // offset behind the last layer's part
  bool finished = false;            // under the final names, with all layers
};

/// big     whether the job writes a BigTIFF
/// errors  of layers_that_hold; kOutput: a link where a file is to be continued
/// cost    reads every file once
Result<KeptPages> find_kept_pages(const Job& job, const ManifestHead& head, bool big);

/// A file of a layer, as stored.
struct StoredFile {
  std::string name;  // layers/000042.tif, program/000042.gcode
  std::span<const std::byte> bytes;
};

class PagedJob {
 public:
  /// Begins the files of the job, or continues them after what is kept, once their manifest is begun. The caller has the claim.
  /// program  null: without a machine
  /// errors   kOutput
  static Result<PagedJob> open(const Job& job, const ManifestHead& head, bool big, const KeptPages& kept,
                               const PrintProgram* program);

  /// Adds the images of a layer and its program, the last one. A killed run leaves them.
  /// synced  a power cut too
  /// errors  kOutput
  Status add(std::span<const StoredFile> files, bool synced);
  /// Ends the files and gives them their names. program  as of open(). errors  kOutput
  Status finish(const PrintProgram* program);
  void discard();

 private:
  PagedJob(std::string directory, File pages, bool big)
      : directory_(std::move(directory)), pages_(std::make_unique<File>(std::move(pages))), writer_(*pages_, big) {}
  std::string directory_;
  std::unique_ptr<File> pages_;
  formats::tiff::PageWriter writer_;
  std::optional<File> program_;
};

}  // namespace lamina::pipeline
