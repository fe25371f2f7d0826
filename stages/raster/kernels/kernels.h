// stages/raster/kernels/kernels.h: the inner loops of the bitmaps, a body for each instruction set.
//
// All bodies of a loop give the same numbers, bit for bit. Integers are the same in any width; doubles are IEEE 754's
// operations in the same order, lane by lane, and nothing is fused (-ffp-contract=off). Where a double does not decide,
// every body calls the same integers (segment.h).
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/choices.h"
#include "stages/raster/segment.h"

namespace lamina::raster {

/// A cluster whose corners are stored in it, as it stands on the bed.
struct ListedSource {
  const Cluster* cluster;
  std::uint32_t first_facet;  // of its mesh
  std::uint32_t instance;
  Point3 offset;  // of the instance, nm
};

/// A cluster whose corners are named, and the step of the plane.
struct IndexedSource {
  const IndexedCluster* cluster;
  const Point3* vertex;       // of its block
  std::uint32_t first_facet;  // of its mesh
  std::uint8_t step;
};

/// Facets that a plane may cut, by the names of their corners. Behind each array room for the widest store; what is
/// fetched early may lie behind the last facet.
struct alignas(64) FoundFacets {
  static constexpr std::uint32_t kRoom = 128;

  const Nm* table[kRoom + kClusterSize] = {};          // of the facet's block
  std::uint32_t corner[3][kRoom + kClusterSize] = {};  // where in the table x is; y and z follow
  std::uint32_t facet[kRoom + kClusterSize];
  std::uint32_t size = 0;

  bool is_full() const { return size > kRoom - kClusterSize; }
};

/// Facets that a plane cuts, on the bed, turned so that the tip is alone on its side of the plane: it cuts the two edges
/// that start there. A coordinate an array, and behind each room for the widest store.
struct alignas(64) CutFacets {
  static constexpr std::uint32_t kRoom = FoundFacets::kRoom;

  struct Corner {
    Nm x[kRoom + kClusterSize], y[kRoom + kClusterSize], z[kRoom + kClusterSize];
    Point3 at(std::uint32_t i) const { return {x[i], y[i], z[i]}; }
  };
  Corner tip, left, right;
  std::uint32_t facet[kRoom + kClusterSize], instance[kRoom + kClusterSize];
  std::uint32_t size = 0;

  bool is_full() const { return size > kRoom - kClusterSize; }
};

/// A band of rows that crossings are written to.
struct FillTask {
  const PixelSampling& sampling;
  const Segments& segments;  // none leaves the band
  std::span<const PlacedMesh> placed;
  Nm plane;
  std::uint32_t first_row;  // of the band
  std::uint32_t* place;     // of each row, where its next crossing goes
  std::uint32_t* crossing;  // column * 2 + (1 if it enters)
};

/// A band of rows whose crossings become changes.
struct RowsTask {
  std::uint32_t* crossing;   // row by row from the front; is overwritten. kMoreCrossings more at the end
  const std::uint32_t* end;  // of each row's crossings
  std::uint32_t rows;
  FillRule rule;
  std::uint32_t* changes;  // the first of the image
  std::uint32_t* change;   // where the next one goes; room for one a crossing and kMoreCrossings
  std::uint32_t* row_end;  // of each row, back row first: where its changes end

  static constexpr std::uint32_t kMoreCrossings = 64;
};

struct Kernels {
  Isa isa;

  /// Appends the facets of a cluster whose steps meet the plane's; `found` must not be full.
  void (*find)(const IndexedSource& source, FoundFacets& found);

  /// Appends those that the plane cuts, all of one instance, for which `facets` must have room. Empties `found`. The height is
  /// on the bed.
  void (*gather)(FoundFacets& found, std::uint32_t instance, const Point3& offset, Nm plane, CutFacets& facets);

  /// Appends the facets of a cluster that the plane cuts; `facets` must not be full. The height is on the bed.
  void (*gather_listed)(const ListedSource& source, Nm plane, CutFacets& facets);

  /// Appends the segments of the facets in geometry rows [row_begin, row_end); a facet cut in none of these rows leaves
  /// none. Empties `facets`.
  void (*cut)(const PixelSampling& sampling, CutFacets& facets, Nm plane, std::uint32_t row_begin, std::uint32_t row_end,
              Segments& out);

  /// Writes the crossings of all segments.
  void (*fill)(const FillTask& task);

  /// Sorts each row's crossings and writes where the fill rule changes, rows from the back of the band to its front.
  /// returns  the end of the changes
  std::uint32_t* (*rows)(const RowsTask& task);
};

/// The bodies for an instruction set that this processor has (geometry/isa.h), not kAuto.
const Kernels& kernels_for(Isa isa);

}  // namespace lamina::raster
