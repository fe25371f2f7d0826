// stages/coverage/slab_facet.h: what of a facet lies in a layer.
#pragma once

#include <array>
#include <cstdint>

#include "stages/coverage/edges.h"
#include "stages/coverage/volume.h"
#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::cover {

/// Room for `count` elements, an eighth more than that at most; what was in it is lost.
template <class T>
void make_room(Buffer<T>& buffer, std::size_t count) {
  if (count <= buffer.capacity()) return;
  buffer = {};
  buffer.reserve(count + count / 8);
}

/// How far computed corners may lie from where they are, nm, and more: those of facets of 4 m by 4 million roundings.
inline constexpr double kRoom = 1.0 / 1024;

struct SlabFacet {
  Triangle facet;                     // nm, on the bed
  Point3 low;                         // lowest corner of its box
  Nm size;                            // longest side of its box
  bool edgewise;                      // seen from along x it has no area
  bool enters;                        // +x goes into the solid
  bool suspect;                       // it meets others (meet/meetings.h)
  std::uint32_t first_row, last_row;  // geometry rows that it may reach; last_row included
  std::array<double, 5> x, y, z;      // of the piece within the layer, from `low`
  std::uint32_t corners;
};

/// A facet in a row.
struct RowFacet {
  std::uint32_t first = 0, last = 0;  // columns that it may reach; last included
  std::uint32_t index = 0;            // among those of the layer
};

/// What lies behind the piece within the layer, up to where x is `end`, nm^3; negative behind facets that +x leaves through.
double volume_behind(const SlabFacet& facet, double end);

/// Fills in everything; false if nothing of the facet lies between the heights, or it has no area at all.
bool take_facet(const Triangle& on_bed, bool suspect, std::int64_t bottom, std::int64_t top, const Edges& rows, SlabFacet& out);

}  // namespace lamina::cover
