// stages/write/manifest/layered_file.h: one file that holds all layers, and the manifest that grows with it.
//
// While the job runs, NAME.part and the manifest's .part grow together: the lines that are whole say how far the file
// stands. They stay after a signal or a kill, and a resumed job goes on behind the last layer whose bytes hold.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/write/manifest/manifest.h"

namespace lamina {

class LayeredFile {
 public:
  struct Options {
    std::string file, manifest;  // paths
    bool resume = false;
    bool stream = false;  // the file may be a device, a pipe or "-": it is written as it comes, and leaves no manifest
  };

  /// start  what stands before the first layer
  /// errors  kUsage: what is to be resumed is of another job; kOutput
  static Result<LayeredFile> open(Options options, const ManifestHead& head, std::string_view start);
  LayeredFile(LayeredFile&&) noexcept;
  LayeredFile& operator=(LayeredFile&&) noexcept;
  ~LayeredFile();

  /// Layers that stand, from the first one on.
  const std::vector<LayerRecord>& kept() const;
  /// Nothing is left to do: file and manifest are finished and hold.
  bool finished() const;

  /// The layer that comes next; its record has its size and hash, gets its place and goes into the manifest.
  Status append(std::string_view text, LayerRecord& record);
  /// A piece of the layer that comes next, of many.
  Status append_piece(std::string_view text);
  /// Ends a layer of pieces: its place, size and hash go into the record, and that into the manifest.
  Status end_pieces(LayerRecord& record);
  /// Adds what stands behind the last layer and gives both files their names. returns  the file's size
  Result<std::uint64_t> finish(std::string_view end);
  /// An interrupted or failed job: whole layers stay, for a resumed run.
  Status keep();
  /// Removes what was begun.
  void discard();
  std::uint64_t size() const;

 private:
  LayeredFile();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina
