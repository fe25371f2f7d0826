// stages/load/stl_binary.h: binary STL as triangles in nm or as blocks; internal to load.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/load/reader.h"

namespace lamina::load {

inline constexpr std::uint64_t kHeaderBytes = 84, kFacetBytes = 50;

/// Lowest and highest coordinate of each axis as the file has them; snapping keeps the order.
struct CoordinateBox {
  std::array<float, 3> lo, hi;
  CoordinateBox() {
    lo.fill(3e38f);
    hi.fill(-3e38f);
  }
};

/// Facets of 50 bytes behind a header of 84: normal (12), three corners of three floats (36), attributes (2).
/// cost    one pass, parallel; 256 KiB a thread besides the triangles
/// source  3D Systems, "StereoLithography Interface Specification" (1989)
Result<Facets> read_binary_stl(const Source& source, const Snapper& snapper, const LoadOptions& options);

/// The same in one pass, where the mesh is sound: closed, as long as its header says, and enclosing something. As blocks, with
/// what load() has to say of it. returns  nothing where the list of triangles is needed to judge, to repair or to refuse
/// see  may be empty; is shown triangles, all of them where a mesh is returned. Nothing is returned where it refuses any
std::optional<Mesh> read_sound_stl(const Source& source, const Snapper& snapper, const LoadOptions& options,
                                   const SeeTriangles& see, std::vector<Note>& notes);

}  // namespace lamina::load
