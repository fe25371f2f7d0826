// stages/load/repair/advice.h: whether a repaired mesh is a solid, and which --weld would make it one; internal to load.
#pragma once

#include <cstdint>

#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/load/repair/repair.h"

namespace lamina::load {

/// Whether a repaired mesh is a solid. errors  kInput, without a file: why it is none
Status check_solid(const Mesh& mesh, const RepairReport& report);

/// By how much of itself the volume of a welded mesh may be off: 0.02 is 2 %. Corners that lie apart by chance lie as far from
/// where they belong as from each other; twice their standard deviation.
double weld_uncertainty(const Mesh& mesh, const RepairReport& report);

/// The smallest distance, doubled again and again, at which the facets become a solid that hardly hangs on caps; 0 if none is
/// found: up to a twentieth of the size, and up to what any edge allows (weld.h).
///
/// tried  distances up to this one are known to close nothing
/// cost   a weld for each distance, a repair for those that close most edges; fewer distances for more than 8 million
///        triangles, so that it takes no longer than two more repairs of such a mesh
std::int64_t weld_that_closes(const Buffer<Triangle>& triangles, const Box& bounds, std::int64_t tried_nm);

}  // namespace lamina::load
