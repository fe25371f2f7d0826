// stages/load/threemf/relationships.h: what leads from a package to its model; internal to load.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/load/source.h"
#include "stages/load/threemf/archive.h"

namespace lamina::load {

/// The one part of a package that is its model, as part_name() gives it.
///
/// errors  kInput: no relationships, none or more than one to a 3D model, one that leads out of the package or to nothing, more
///         than one print ticket
/// source  3MF Consortium, Core Specification 1.3, section 2.1
Result<std::string> find_start_part(const Source& source, Archive& archive);

}  // namespace lamina::load
