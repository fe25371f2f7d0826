// stages/formats/threemf/slice3mf.h: slices as a 3MF package with the slice extension.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/formats/slice_format.h"
#include "stages/formats/zip/zip.h"
#include "stages/support/io/file.h"

namespace lamina::formats {

/// Gathers slices, deflated as they come, about 5 bytes a point, and writes the package at the end: each body's slices stand
/// in one piece there, and a layer brings a slice of every body. Numbers are exact to the nanometre. Coordinates count from
/// the whole mm below the front left of all parts, where the build items stand.
class Slice3mfWriter {
 public:
  /// head  one object for each body, with a box as its mesh where none is given: the extension wants one
  /// errors  of check_3mf_date
  static Result<Slice3mfWriter> make(const SliceHead& head);

  /// Layers from the bottom up. errors  kOutput
  Status add(const SliceLayer& layer);
  /// Writes the package; it takes its name when the file is finished. errors  kOutput
  Result<File> write(const std::string& path, const FileOptions& options = {});

 private:
  struct PartBody {
    std::string name;
    Deflated slices;
    Buffer<char> waiting;  // text that is deflated when there is enough of it
  };
  explicit Slice3mfWriter(const SliceHead& head);
  std::string objects_and_build() const;

  Box bounds_;
  Nm first_bottom_;
  std::int64_t left_, front_;  // nm, whole mm: where the items stand, and what their coordinates count from
  std::vector<PartBody> bodies_;
};

}  // namespace lamina::formats
