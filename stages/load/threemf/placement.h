// stages/load/threemf/placement.h: meshes of a package are snapped where they stand, copies once; internal to load.
#pragma once

#include <span>

#include "stages/load/threemf/expansion.h"
#include "stages/load/threemf/threemf.h"

namespace lamina::load {

/// Snaps leaf after leaf. One whose vertices all snap to those of an earlier leaf but for a whole translation shares its
/// mesh. Most need no pass over their vertices: where translations differ by whole nanometres and too little to round any
/// coordinate otherwise, the rest follows. One that is a void becomes a hollow of its container, with a note.
///
/// cost  a leaf that is known to be a copy: nothing; any other one: three passes over its triangles, parallel
/// errors  kInput: a coordinate is not finite or beyond reach
Status snap_leaves(const Source& source, const ModelPackage& model, std::span<const Leaf> leaves, const LoadOptions& options,
                   Package& to);

}  // namespace lamina::load
