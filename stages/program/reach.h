// stages/program/reach.h: whether a part lies where a machine can print.
#pragma once

#include <optional>

#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"

namespace lamina::program {

struct Outside {
  Point3 position;       // nm on the bed
  bool above = false;    // of the build height, else beside the bed
  double beyond_mm = 0;  // how far
};

/// The vertex of a mesh that lies farthest outside of the bed, or above it; nothing if there is none. A bed is convex, so
/// that vertices speak for triangles. Decided in integers: a round bed holds (x - r)^2 + (y - r)^2 <= r^2, r half its
/// diameter in nm, doubled to stay whole.
/// offset  nm, added to every vertex
std::optional<Outside> first_outside(const Machine& machine, const Mesh& mesh, const Point3& offset);

/// The first set pixel of an image, row by row, whose centre lies outside of the bed; z is not known. Images of parts that are
/// no meshes are looked at so, layer by layer. cost  O(rows), none for rectangular beds, which images never leave
std::optional<Outside> first_outside(const Machine& machine, const PixelGrid& grid, const RunsView& image);

}  // namespace lamina::program
