// stages/load/threemf/model_parser.h: the XML of a 3MF model becomes objects and build items; internal to load.
#pragma once

#include "stages/load/threemf/archive.h"
#include "stages/load/threemf/model.h"

namespace lamina::load {

/// Understands the core specification and the paths of the production extension, of any prefix. Properties of materials are
/// passed over; what other extensions say is counted, or noted by its namespace. Unknown attributes do not matter.
///
/// source  3MF Consortium, Core Specification 1.3; Production Extension 1.1
///
/// file            index in package.files: the one that is parsed
/// triangle_limit  of all objects of the package together
/// package         gets what is found; a path to a file that it does not know adds it
Status parse_model(const Source& source, Archive& archive, std::uint32_t file, std::uint64_t triangle_limit,
                   ModelPackage& package);

}  // namespace lamina::load
