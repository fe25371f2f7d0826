// pipeline/output/job_container.h: a powder job in one ZIP file (--container zip), written in the order of layers.
//
//   NAME.zip            program/machine.toml, program/start.*, then the files of each layer, program/end.*, inspection.json,
//                       manifest.json. Entries are stored as they are: each has the bytes of the file in a job's directory
//   NAME.zip.part       while the job runs, and NAME.zip.json.part, its begun manifest; both are what --resume continues
// The same job gives the same bytes, however often it was interrupted.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/manifest/manifest.h"
#include "stages/data/status.h"
#include "stages/formats/zip/zip.h"
#include "stages/support/io/container.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"

namespace lamina::pipeline {

/// The name that the begun manifest of a container would get: it grows as its .part, and ends as the last entry.
std::string container_manifest(const Job& job);

/// Whether the files of the program next to those of layers are what the job writes. end  the last one too
bool has_program_frame(const std::string& output, const ManifestHead& head, bool end);

/// Checks that a job may write its container. Changes nothing.
/// errors  kUsage: a job is there, without --resume or --overwrite, or somebody else's NAME.part; kVerification: what is to be
///         continued is damaged; kOutput: a directory, or another run writes it
Status check_container(const Job& job);

/// Whether all entries of a finished container have the bytes that their CRC states. cost  reads the container
bool has_whole_entries(const std::string& container);

/// Claims the container for the rest of the run and makes the folders above it. errors  of check_container and Claim::take
Result<Claim> claim_container(const Job& job, MadeFolders& made);

/// What a job that is to be resumed has in its container.
struct KeptContainer {
  std::vector<LayerRecord> layers;      // from the first on
  std::vector<ContainerEntry> entries;  // up to the last of those layers
  std::uint64_t end = 0;                // offset behind them
  bool finished = false;                // under its final name, with all layers
  bool replaces = false;                // what has the final name is a container that the job may replace
};

/// A finished container that lacks layers, or has damaged ones, is not continued: all layers are made again.
/// errors  of layers_that_hold; kUsage: the container is of other layers or another program
/// cost    reads every file twice
Result<KeptContainer> find_kept_container(const Job& job, const ManifestHead& head);

class JobContainer {
 public:
  /// Begins NAME.zip.part, or continues it after what is kept. The caller holds the claim.
  /// errors  kOutput
  static Result<JobContainer> open(const Job& job, const KeptContainer& kept);

  /// crc  as of formats::crc_of(). errors  kOutput
  Status add(std::string_view name, std::span<const std::byte> bytes, std::uint32_t crc);
  Status add(std::string_view name, std::span<const std::byte> bytes) { return add(name, bytes, formats::crc_of(bytes)); }
  /// A killed run leaves what was added. synced  a power cut too. errors  kOutput
  Status flush(bool synced);
  /// Adds the last files and gives the container its name.
  /// inspection  text of inspection.json; "": none
  /// manifest    name of its entry, and where its text is
  /// errors      kOutput
  Status finish(std::string_view inspection, std::string_view manifest, const std::string& manifest_path);
  void discard();

 private:
  explicit JobContainer(File file) : file_(std::make_unique<File>(std::move(file))), zip_(*file_) {}
  std::unique_ptr<File> file_;
  formats::ZipWriter zip_;
};

}  // namespace lamina::pipeline
