// stages/program/bed.h: the bed of a machine: parts outside of it, the layer that fills it, and a target that shows its axes.
#pragma once

#include <cstddef>
#include <optional>

#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/mesh.h"
#include "stages/data/runs.h"
#include "stages/geometry/bits.h"

namespace lamina::program {

struct Outside {
  Point3 position;       // nm on the bed
  bool above = false;    // of the build height, else off the bed
  double beyond_mm = 0;  // how far
};

/// The vertex of a mesh that lies farthest outside of the bed, or above it; nothing if there is none. A bed is convex, so
/// that vertices speak for triangles. Decided in integers: a round bed holds (x - r)^2 + (y - r)^2 <= r^2, r half its
/// diameter in nm, doubled to stay whole.
/// offset  nm, added to every vertex
std::optional<Outside> first_outside(const Machine& machine, const Mesh& mesh, const Point3& offset);

/// The first set pixel of an image, row by row, whose centre lies outside of the bed; z is not known. Images of parts that are
/// no meshes are checked so, layer by layer. cost  O(rows), none for rectangular beds, which images never leave
std::optional<Outside> first_outside(const Machine& machine, const PixelGrid& grid, RowRuns image);

/// A letter F, 20 x 30 x 3 mm, as a binary STL in mm: the stem lies along +y, the arms point to +x, the longer one is at
/// the far end (+y), and a step of 1 mm on top of the foot marks the top. It has no symmetry, so that a print that
/// can be read is neither mirrored nor turned over.
Buffer<std::byte> orientation_target();

/// The image of a layer that sets every pixel whose centre lies on the bed.
Runs image_of_bed(const Machine& machine, const PixelGrid& grid);

}  // namespace lamina::program
