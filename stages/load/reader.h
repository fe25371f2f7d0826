// stages/load/reader.h: what the readers of formats return; internal to load.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/load/load.h"
#include "stages/load/source.h"
#include "stages/load/transform.h"

namespace lamina::load {

/// The file's length contradicts what it says about itself. If its facets close, the statement was wrong and the
/// facets are right; if not, some of them are missing.
struct ReadWarning {
  std::string note;                // if the mesh is balanced
  std::string error;               // if it is not, and `claimed` is 0
  std::uint64_t claimed = 0;       // facets that the file says it holds where it holds more: the others may be rubbish
  std::string rest_left_out = {};  // note if only those are taken
};

/// A closed mesh whose volume is at most this share of its box may enclose nothing: its pieces are inspected (enclosed.h).
inline constexpr double kHardlyAny = 1e-6;

/// The triangles of a file in its order, turned over if the transform mirrors.
struct Facets {
  Buffer<Triangle> triangles;
  Box bounds;
  std::vector<Note> notes;
  std::optional<ReadWarning> warning;
};

}  // namespace lamina::load
