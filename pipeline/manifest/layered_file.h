// pipeline/manifest/layered_file.h: a single file of all layers with its manifest, and what an interrupted job of contours or
// toolpaths has on record.
//
// While the job runs, NAME.part and the manifest's .part grow together: the complete lines give the valid length of the
// file. Both survive a signal or a kill, and a resumed job continues after the last intact layer.
//
// Files a layer wait in a folder next to the begun manifest, until all are there. Then manifest.json of an earlier job goes,
// they get their names, and the new manifest.json comes last: whenever a run is killed, one of the two records holds.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/buffer.h"
#include "stages/data/status.h"

namespace lamina {

/// Refuses records of another job, or of other layers. path  of the manifest, for the error. errors  kUsage
Status check_same_job(const std::string& path, const Manifest& manifest, const ManifestHead& head);

/// The records, from the first on, whose bytes are in one file; none if it does not begin with `start`.
/// cost  reads the file once
std::vector<LayerRecord> records_that_hold(const std::string& file, const std::vector<LayerRecord>& recorded,
                                           std::string_view start);

/// What the records of a directory of contours account for.
struct OnRecord {
  bool finished = false, begun = false;  // manifest.json, and the head of its .part, are there
  bool all_made = false;                 // the begun one has all its layers: the job may have given names
  std::vector<std::string> layers;       // files of manifest.json with the folder, sorted as text
};
OnRecord find_on_record(const std::string& directory);
/// Whether a file of layers/ is one of them. name  without the folder
bool is_on_record(const OnRecord& record, std::string_view name);

/// Gives waiting files their places in another folder, which may be there. errors  kOutput
Status take_waiting(const std::string& waiting, const std::string& folder);

/// Checks, before layers are made, that they will get their places: the folder is absent, or can be written. errors  kOutput
Status check_takes_layers(const std::string& folder);

/// What a directory holds of a job that is to be resumed.
struct KeptJob {
  std::vector<LayerRecord> layers;  // from the first on
  bool finished = false;            // all of the job, under its final names
  std::uint64_t bytes = 0;          // of its files
};

/// Of a job with files a layer, with a package or without files. Layers of a run that was killed while they got their names
/// are brought back to `waiting`, and its torn files go. Links are no files of a job.
/// errors  kUsage: the directory belongs to another job; those of read_manifest
/// cost    reads every file once
Result<KeptJob> find_kept_job(const std::string& directory, const std::string& waiting, const ManifestHead& head);

class LayeredFile {
 public:
  struct LayeredFileOptions {
    std::string file, manifest;  // paths
    bool resume = false;         // replaces an earlier file too, if a record of it is there
    bool replace = false;        // an earlier file of that name
    Sync sync = Sync::kJob;
    bool stream = false;  // accepts a device, a pipe or "-": written directly, without a manifest
  };

  /// start   text before the first layer
  /// claim   of the manifest; none: it is taken here
  /// errors  kUsage: the files to resume belong to another job; a file or NAME.part is there that must not be replaced;
  ///         kOutput
  static Result<LayeredFile> open(LayeredFileOptions options, const ManifestHead& head, std::string_view start,
                                  std::optional<Claim> claim = {});
  LayeredFile(LayeredFile&&) noexcept;
  LayeredFile& operator=(LayeredFile&&) noexcept;
  ~LayeredFile();

  /// The intact layers, from the first on.
  const std::vector<LayerRecord>& kept() const;
  /// Whether file and manifest are already finished and intact.
  bool finished() const;

  /// Appends the next layer. The record has size and hash; its offset is set, and it is added to the manifest.
  Status append(std::string_view text, LayerRecord& record);
  /// Appends one piece of the next layer.
  Status append_piece(std::string_view text);
  /// Ends a layer of pieces: sets offset, size and hash of the record, and adds it to the manifest.
  Status end_pieces(LayerRecord& record);
  /// Appends the text after the last layer and renames both files.
  /// names    as of ManifestWriter::finish, before the file takes its name: removes the manifest of an earlier job
  /// returns  the file's size
  Result<std::uint64_t> finish(std::string_view end, const std::function<Status()>& names = {});
  /// Ends an interrupted or failed job; complete layers stay for a resumed run.
  Status keep();
  /// Removes the started files.
  void discard();
  std::uint64_t size() const;

  /// Whether NAME.part, if there is one, has its record next to it. errors  kUsage: it is not lamina's
  static Status check_part(const std::string& file, const std::string& manifest);

 private:
  LayeredFile();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina
