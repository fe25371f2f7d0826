// pipeline/output/slice_files.h: writes the layers of a sliced job into one file (SVG, CLI, 3MF) or one
// per layer, and the manifest next to them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/manifest/layered_file.h"
#include "pipeline/plan/plan.h"
#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/formats/slice_format.h"
#include "stages/formats/threemf/threemf.h"
#include "stages/support/io/file.h"
#include "stages/support/io/sync.h"
#include "stages/support/io/temporary.h"

namespace lamina::pipeline {

class SliceFiles {
 public:
  /// The plan must outlive this object.
  explicit SliceFiles(const Plan& plan);
  /// Removes the waiting layers of an unfinished job.
  ~SliceFiles();

  /// errors  kUsage, kOutput
  Status open();
  /// The finished layers of an interrupted job, from the first on.
  const std::vector<LayerRecord>& kept() const { return file_ ? file_->kept() : kept_.layers; }
  /// The output path for the summary.
  std::string output() const;
  /// Bytes of text for points and paths.
  Sections::TextBytes text_bytes() const { return {format_.point_bytes, format_.interval_bytes, 0}; }

  // --- from many threads at once, each with its own text
  /// errors  kUsage: the format cannot hold the layer
  Status encode(const formats::SliceLayer& layer, Buffer<char>& text) const;
  /// Stores size and hash of the text in the record; writes the file if layers have their own. errors  kOutput
  Status store(std::uint32_t index, const Buffer<char>& text, LayerRecord& record) const;

  // --- from one thread at a time, in layer order
  /// Whether record() reads the layer; else its text alone.
  bool records_contours() const { return package_.has_value(); }
  Status record(const formats::SliceLayer& layer, const Buffer<char>& text, LayerRecord& record);
  /// returns  the bytes of all files
  Result<std::uint64_t> finish();
  Status keep();
  void discard();
  /// Whether an interrupted job can be resumed.
  bool keeps() const { return file_.has_value() || (file_a_layer_ && encoder_); }

 private:
  Status open_single(const ManifestHead& head, Claim claim);
  Result<File> write_package();

  const Plan& plan_;
  const formats::SliceFormat& format_;
  const bool file_a_layer_;
  formats::SliceHead head_;
  std::unique_ptr<formats::SliceEncoder> encoder_;  // of text formats
  std::optional<formats::Slice3mfWriter> package_;  // 3MF
  std::optional<LayeredFile> file_;                 // of one text file
  std::optional<ManifestWriter> manifest_;          // of all others
  std::optional<FolderSync> sync_;                  // of files a layer
  KeptJob kept_;                                    // of all others
  MadeFolders made_;
  std::uint64_t bytes_ = 0;
  bool finished_ = false, waits_ = false;  // waits: files a layer stay where --resume finds them
};

// --- the files of a sliced job, and the removal of an earlier job's.

/// ".svg", ".cli" or ".3mf"
std::string_view slice_extension(const Job& job);

/// Name of the single file: the first part's name with the format's extension.
std::string slice_file_name(const Job& job);

/// Refuses a directory with another job, or files without a record, unless job.overwrite is set. errors  kUsage, kOutput
Status check_slice_output(const Job& job);

/// Temporary directory of per-layer files until all are written.
std::filesystem::path waiting_layers(const Job& job);

/// Makes the folder of waiting layers for a job that has them; of an earlier run it stays only if `keeps`. errors  kOutput
Status prepare_waiting_layers(const Job& job, bool keeps);

/// The files that an earlier job leaves to this one, its manifest last: what is left of a killed removal is on record. Without
/// job.overwrite, no layers without a record.
std::vector<std::filesystem::path> earlier_slices(const Job& job);

/// Call when the job is complete: removes earlier files in their order, and renames the waiting layers. errors  kOutput
Status replace_slices(const Job& job, const std::vector<std::filesystem::path>& earlier);

/// Of a job that has failed; what cannot be removed is noted (stages/support/io/temporary.h).
void remove_waiting_layers(const Job& job);

}  // namespace lamina::pipeline
