// stages/raster/kernels/kernels.h: the inner loops of the bitmaps, and of what their layers are bounded by, a body for each
// instruction set.
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

/// What an engine finds: a cluster that a plane may cut.
struct ClusterVisit {
  std::uint32_t cluster;   // in its mesh
  std::uint32_t instance;  // in the scene
};

/// Clusters of one block whose corners are named, and the step of the plane.
struct IndexedSource {
  const IndexedCluster* cluster;  // one of them
  std::uint32_t number;           // of that one in its mesh
  const Point3* vertex;           // of the block
  std::uint8_t step;

  const IndexedCluster& at(const ClusterVisit& visit) const {
    return cluster[std::int64_t{visit.cluster} - std::int64_t{number}];
  }
};

/// Facets of one instance that a plane may cut, by the positions of their corners. Behind each array is a margin for the widest
/// store; what is fetched early may lie behind the last facet.
struct alignas(64) FoundFacets {
  static constexpr std::uint32_t kCapacity = 256;

  std::int32_t corner[3][kCapacity + kClusterSize] = {};  // where x is, counted from `base`; y and z follow
  std::uint32_t facet[kCapacity + kClusterSize];
  const Nm* base = nullptr;  // a vertex of the mesh
  std::uint32_t size = 0;

  bool is_full() const { return size > kCapacity - kClusterSize; }
  /// Whether vertices of a block can be named; counting starts anew where no facet is left.
  bool reaches(const Point3* vertex) {
    if (size == 0) base = &vertex->x;
    const std::int64_t away = &vertex->x - base;
    return away >= INT32_MIN / 2 && away <= INT32_MAX / 2;
  }
  std::int32_t first_of(const Point3* vertex) const { return static_cast<std::int32_t>(&vertex->x - base); }
};

/// Facets that a plane cuts, on the bed, turned so that the tip is alone on its side of the plane: it cuts the two edges
/// that start there. A number an array, and behind each a margin for the widest store.
struct alignas(64) CutFacets {
  static constexpr std::uint32_t kCapacity = FoundFacets::kCapacity;
  static constexpr std::uint32_t kStride = kCapacity + kClusterSize;

  /// What is known of a facet. Up is from the tip to the plane; the others are edges from the tip.
  enum Number : std::uint32_t { kTipX, kTipY, kUp, kLeftX, kLeftY, kLeftZ, kRightX, kRightY, kRightZ, kNumbers };
  Nm number[kNumbers][kStride];
  std::uint32_t facet[kStride], instance[kStride];
  std::uint32_t size = 0;

  bool is_full() const { return size > kCapacity - kClusterSize; }
};

/// What of a layer all cuts share.
struct CutTask {
  const PixelSampling& sampling;
  Nm plane;                          // on the bed
  std::uint32_t row_begin, row_end;  // geometry rows
  Segments& out;
};

/// A band of rows that crossings are written to.
struct FillTask {
  const PixelSampling& sampling;
  const Segments& segments;  // none leaves the band
  std::span<const PlacedMesh> placed;
  Nm plane;
  std::uint32_t first_row;  // of the band
  std::uint32_t* position;  // of each row, where its next crossing goes
  std::uint32_t* crossing;  // column * 2 + (1 if it enters)
};

/// A band of rows whose crossings become changes.
struct RowsTask {
  std::uint32_t* crossing;   // row by row from the front; is overwritten. kMoreCrossings more at the end
  const std::uint32_t* end;  // of each row's crossings
  std::uint32_t rows;
  FillRule rule;
  std::uint32_t* changes;  // the first of the image
  std::uint32_t* change;   // where the next one goes; capacity for one a crossing and kMoreCrossings
  std::uint32_t* row_end;  // of each row, back row first: where its changes end

  static constexpr std::uint32_t kMoreCrossings = 64;
};

/// A cluster projected along x.
struct alignas(64) Sides {
  Nm z[3][kClusterSize];
  Nm y[3][kClusterSize];
};

/// The tents of a cluster's facets (layer_bound.h). Facets that no plane cuts have neither slopes nor count.
struct alignas(64) Tents {
  std::int32_t begin[kClusterSize], end[kClusterSize];  // slabs that the facet reaches, the latter beyond the last
  std::int32_t top[kClusterSize], fall[kClusterSize];   // from here on it no longer rises, and it falls
  /// nm a slab. Multiples of 2^-16: doubles add them to the same sum in any order while it stays below 2^37. Each is the same
  /// number times the slabs of the other slope, so that a tent returns to exactly nothing.
  float up[kClusterSize], down[kClusterSize];
  std::int32_t count[kClusterSize];  // 1 where a plane cuts it
};

struct Kernels {
  Isa isa;

  /// Appends the facets whose steps meet the plane's, of visits to one block that `found` reaches, until it is full or none
  /// is left.
  /// returns  how many visits were taken
  std::size_t (*find)(const IndexedSource& source, std::span<const ClusterVisit> visits, FoundFacets& found);

  /// Appends the segments of those that the plane cuts, all of one instance. Empties `found`. A facet cut in none of the
  /// task's rows leaves none.
  void (*cut_found)(const CutTask& task, std::uint32_t instance, const Point3& offset, FoundFacets& found);

  /// Appends the facets of a cluster that the plane cuts; `facets` must not be full. The height is on the bed.
  void (*gather_listed)(const ListedSource& source, Nm plane, CutFacets& facets);

  /// Appends the segments of the facets as cut_found() does. Empties `facets`.
  void (*cut)(const CutTask& task, CutFacets& facets);

  /// Writes the crossings of all segments.
  void (*fill)(const FillTask& task);

  /// Sorts each row's crossings and writes where the fill rule changes, rows from the back of the band to its front.
  /// returns  the end of the changes
  std::uint32_t* (*rows)(const RowsTask& task);

  /// Fetches an indexed cluster's corners.
  void (*load_sides)(const IndexedCluster& cluster, const Point3* vertices, Sides& sides);

  /// Bounds what a plane can meet of each facet, slab by slab. Slabs are 2^shift nm high and counted from `first`, and no more
  /// than 2^13.
  void (*raise_tents)(const Sides& sides, std::uint32_t shift, std::int32_t first, Tents& tents);
};

/// The bodies for an instruction set that this processor has (geometry/isa.h), not kAuto.
const Kernels& kernels_for(Isa isa);

}  // namespace lamina::raster
