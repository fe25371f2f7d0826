// stages/formats/threemf/mesh3mf.h: meshes as a 3MF file (core specification).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/support/io/file.h"

namespace lamina::formats {

/// An object of the file.
struct Mesh3mfObject {
  std::string name;                     // shown by other programs; "" for none
  std::span<const Triangle> triangles;  // nm, corners counter-clockwise viewed from outside; borrowed
};

struct Mesh3mfCounts {
  std::uint64_t vertices = 0, triangles = 0;  // of all objects, once each
  std::uint64_t degenerate = 0;               // triangles of two equal corners: 3MF forbids them, and no solid needs them
};

/// Writes each object once and a build item for each instance, which is moved by its offset. Numbers are mm with as many
/// decimals as they need, at most 6, exact to the nanometre. Equal corners are one vertex, numbered in the order of their first
/// triangle, so a closed mesh is closed to every reader. The same meshes give the same bytes with any threads.
///
/// file       open, at its beginning (an open File of this folder's file.h); the caller finishes it
/// instances  Instance::mesh is an index into `objects`; at least one
/// program    stated as the application, such as "lamina 0.1.0"
/// errors     kOutput; kInput: an object without any triangle of three different corners, which 3MF cannot hold (begins with
///            the object's name, not with a file's)
/// cost       parallel; 60 bytes a vertex while an object is indexed, and the compressed file (about 10 bytes a triangle)
/// source     3MF Consortium, Core Specification 1.3, sections 3 and 4
Result<Mesh3mfCounts> write_mesh_3mf(File& file, std::span<const Mesh3mfObject> objects, std::span<const Instance> instances,
                                     std::string_view program);

}  // namespace lamina::formats
