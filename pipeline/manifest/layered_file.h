// pipeline/manifest/layered_file.h: a single file of all layers, and its manifest.
//
// While the job runs, NAME.part and the manifest's .part grow together: the complete lines give the valid length of the
// file. Both survive a signal or a kill, and a resumed job continues after the last intact layer.
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

  /// Whether NAME.part, if there is one, has its record beside it. errors  kUsage: it is somebody else's
  static Status check_part(const std::string& file, const std::string& manifest);

 private:
  LayeredFile();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina
