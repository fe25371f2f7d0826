// stages/write/slice3mf/slice3mf.h: slices as a 3MF package with the slice extension, through lib3mf.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/write/slice_format.h"

namespace lamina::write {

/// Gathers slices in lib3mf's model and writes the package at the end. The library keeps the whole model in memory,
/// about 12 bytes a point, and writes numbers with six significant digits: coordinates count from the whole mm below the
/// front left of all parts, where the build items stand, so those of a part of 100 mm are within 0.05 micrometres to
/// 10 mm, 0.5 to 100 mm.
class Slice3mfWriter {
 public:
  /// head  one object for each body, with a box as its mesh where none is given: the extension wants one
  static Result<Slice3mfWriter> make(const SliceHead& head);
  Slice3mfWriter(Slice3mfWriter&&) noexcept;
  ~Slice3mfWriter();

  /// Layers from the bottom up.
  Status add(const SliceLayer& layer);
  /// Writes the package; it appears under its name only when it is whole. errors  kOutput
  Status finish(const std::string& path);

 private:
  Slice3mfWriter();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lamina::write
