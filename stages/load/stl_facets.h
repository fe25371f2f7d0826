// stages/load/stl_facets.h: facets of binary STL become triangles in nm; internal to load.
#pragma once

#include <array>
#include <cstdint>

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

/// The box around facets; boxes of parts of a file add up in any order.
struct FacetBox {
  CoordinateBox plain;  // of a file in plain millimetres
  Box transformed;      // nm, of any other

  void add(const FacetBox& other);
  Box nm(const Snapper& snapper) const;
};

/// The coordinates are millimetres and stay where they are.
inline bool is_plain(const Snapper& snapper) { return snapper.plain() && !snapper.mirrors(); }

/// Snaps one facet, turned over if the transform mirrors.
Snapped snap_facet(const char* facet, const Snapper& snapper, Triangle& out);

/// Snaps facets that follow each other, and grows the box by them. isa  the widest instruction set to use
/// false  one of them cannot be snapped
bool snap_facets(const char* facets, std::size_t count, const Snapper& snapper, Isa isa, Triangle* out, FacetBox& box);

/// How many facets a file holds, with what there is to say about it in `facets`.
/// errors  kInput: the header and the length of the file contradict each other, or there are more than the limit
Result<std::uint64_t> count_facets(const Source& source, const LoadOptions& options, Facets& facets);

}  // namespace lamina::load
