// stages/raster/kernels/bodies.h: the bodies themselves, and what they share. Those of an instruction set are functions with
// that target, so that the rest of the program runs on any processor.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>

#include "stages/geometry/targets.h"
#include "stages/raster/kernels/kernels.h"

namespace lamina::raster {

/// Slopes beyond this are left to integers. Below it a guess is off by less than 0.03 nm. An end is known to 1.25 * 2^-20 nm in
/// x and y: a share of an edge, below 2^31 nm, that four operations round, and a sum. The line through two such ends runs
/// within (1 + slope) * 3.5 * 2^-20 nm of the facet's between them, however close they are. Products on the way to a guess are
/// below 2^43 nm, and eight operations round them.
///
/// A ray enters where nx of the facet's normal is below 0. In y the left end less the right one is up * nx / (left z * right
/// z), and up, left z and right z have one sign. So nx has the sign of the ends' rows, left less right, turned over where left
/// z is below 0: rows are exact, and a segment whose ends have one row leaves nothing. Upright are those whose edges have no x,
/// so that their slope is 0; a slanted facet along y is met by decide_near().
inline constexpr double kSteepest = 4096;

/// A mesh is larger than the caches: find() fetches clusters early, and the first corners of every other one of as many facets
/// as most clusters have, found or not. No processor foresees the end of a loop over those that there are. This is inlined:
/// compilers take a function that does nothing else for one without effect, and leave calls of it out.
inline constexpr std::uint32_t kCornersAhead = kClusterSize / 2;
inline constexpr std::size_t kClustersAhead = 8;
[[gnu::always_inline]] inline void fetch_early(const IndexedSource& source, std::span<const ClusterVisit> visits, std::size_t i,
                                               const FoundFacets& found, std::uint32_t first) {
  const auto* const later = reinterpret_cast<const char*>(&source.at(visits[std::min(i + kClustersAhead, visits.size() - 1)]));
  __builtin_prefetch(later);
  __builtin_prefetch(later + sizeof(IndexedCluster) / 2);
  for (std::uint32_t k = first; k < first + kCornersAhead; k += 2) __builtin_prefetch(found.base + found.corner[0][k]);
}

/// The plane in the frame of a mesh, where corners lie, and up to where corners count as in it; one out of reach of any corner
/// cuts nothing.
struct PlaneInMesh {
  Nm z, reach;
};
inline PlaneInMesh plane_in_mesh(Nm plane, const Point3& offset) {
  constexpr std::int64_t kMin = std::numeric_limits<Nm>::min(), kMax = std::numeric_limits<Nm>::max();
  const auto within = [&](std::int64_t z) { return static_cast<Nm>(std::clamp(z, kMin, kMax)); };
  const std::int64_t z = std::int64_t{plane} - offset.z;
  return {within(z), within(z + kPlaneReach)};
}

/// The first row at or beyond the point in which the plane meets an edge, decided in integers. The plane is `up` above the tip.
[[gnu::cold]] std::uint32_t exact_end(const PixelSampling& sampling, Nm tip_y, Nm up, Nm edge_y, Nm edge_z);

/// Edges from the tip of a cut facet that rise or fall by less may belong to a horizontal face in the plane (LevelFace).
inline constexpr std::int32_t kLevelEdge = 2048;
static_assert(kLevelEdge > 2 * kLevelReach);

/// Adds facets to the horizontal faces of the layer, if they are part of one, in the band in which their first row lies.
/// number     of the first facet (CutFacets)
/// lanes      of the facets, a bit each
/// instance   of each facet
[[gnu::cold]] void note_level(const CutTask& task, const Nm* number, std::uint32_t lanes, const std::uint32_t* instance);

/// The crossing of a segment with a row, decided in integers.
std::uint32_t exact_crossing(const FillTask& task, std::size_t segment, std::uint32_t row);

/// Four numbers side by side, on any processor that compilers know.
using FourWords = std::uint32_t __attribute__((vector_size(16)));

/// Writes the crossings of the first four of `left` rows of a segment, or of all. Of four rows all places are moved on, two a
/// word, before any crossing is written: no load has to wait for the address of a store.
inline void put_rows(std::uint32_t* crossing, std::uint32_t* position, std::uint32_t left, FourWords value) {
  if (left >= 4) {
    constexpr std::uint64_t kOneEach = std::uint64_t{1} << 32 | 1;  // no place is 2^32 - 1
    constexpr std::uint32_t kSecond = std::endian::native == std::endian::little ? 32 : 0, kFirst = 32 - kSecond;
    std::uint64_t at[2], next[2];
    std::memcpy(at, position, sizeof at);
    next[0] = at[0] + kOneEach;
    next[1] = at[1] + kOneEach;
    std::memcpy(position, next, sizeof next);
    crossing[static_cast<std::uint32_t>(at[0] >> kFirst)] = value[0];
    crossing[static_cast<std::uint32_t>(at[0] >> kSecond)] = value[1];
    crossing[static_cast<std::uint32_t>(at[1] >> kFirst)] = value[2];
    crossing[static_cast<std::uint32_t>(at[1] >> kSecond)] = value[3];
    return;
  }
  // One, two or three rows, which no processor guesses: a row that is not there is the one before, written again.
  const std::uint32_t second = left / 2, third = left - 1;
  std::uint32_t of_row[4];
  std::memcpy(of_row, &value, sizeof of_row);
  const std::uint32_t at = position[0], at_second = position[second], at_third = position[third];
  position[0] = at + 1;
  position[second] = at_second + 1;
  position[third] = at_third + 1;
  crossing[at] = of_row[0];
  crossing[at_second] = of_row[second];
  crossing[at_third] = of_row[third];
}

/// The crossings of four rows from `row` on, of which those of the lanes in `near` are decided in integers.
[[gnu::cold]] FourWords decide_near(const FillTask& task, std::size_t segment, std::uint32_t row, std::uint32_t left,
                                    std::uint32_t near, FourWords value);

/// Writes all crossings of a segment that is exact in every row, or of an upright one, which have one column.
void fill_exactly(const FillTask& task, std::size_t segment);

/// Writes a row of two crossings, in any order, if they are its two changes; false if they are not.
inline bool put_pair(const std::uint32_t* row, bool positive, std::uint32_t* change) {
  const std::uint32_t low = std::min(row[0], row[1]), both = row[0] ^ row[1];
  change[0] = low >> 1;
  change[1] = (low ^ both) >> 1;
  return both >= 2 && (both & (positive ? low : 1) & 1) != 0;
}

/// Writes the changes of a row whose crossings are sorted behind `change`, by any rule; they may be the crossings' own places.
/// returns  their end
std::uint32_t* write_changes(FillRule rule, const std::uint32_t* crossing, const std::uint32_t* end, std::uint32_t* change);

namespace plain {
std::size_t find(const IndexedSource& source, std::span<const ClusterVisit> visits, FoundFacets& found);
void cut_found(const CutTask& task, std::uint32_t instance, const Point3& offset, FoundFacets& found);
void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets);
void cut(const CutTask& task, CutFacets& facets);
void fill(const FillTask& task);
std::uint32_t* rows(const RowsTask& task);
void load_sides(const IndexedCluster& cluster, const Point3* vertices, Sides& sides);
void raise_tents(const Sides& sides, std::uint32_t shift, std::int32_t first, Tents& tents);
}  // namespace plain

#if defined(LAMINA_WIDE_KERNELS)
namespace avx2 {
LAMINA_AVX2 std::size_t find(const IndexedSource& source, std::span<const ClusterVisit> visits, FoundFacets& found);
LAMINA_AVX2 void cut_found(const CutTask& task, std::uint32_t instance, const Point3& offset, FoundFacets& found);
LAMINA_AVX2 void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets);
LAMINA_AVX2 void cut(const CutTask& task, CutFacets& facets);
LAMINA_AVX2 void fill(const FillTask& task);
LAMINA_AVX2 std::uint32_t* rows(const RowsTask& task);
LAMINA_AVX2 void raise_tents(const Sides& sides, std::uint32_t shift, std::int32_t first, Tents& tents);
}  // namespace avx2

namespace avx512 {
LAMINA_AVX512 std::size_t find(const IndexedSource& source, std::span<const ClusterVisit> visits, FoundFacets& found);
LAMINA_AVX512 void cut_found(const CutTask& task, std::uint32_t instance, const Point3& offset, FoundFacets& found);
LAMINA_AVX512 void gather_listed(const ListedSource& source, Nm plane, CutFacets& facets);
LAMINA_AVX512 void cut(const CutTask& task, CutFacets& facets);
LAMINA_AVX512 void fill(const FillTask& task);
LAMINA_AVX512 std::uint32_t* rows(const RowsTask& task);
LAMINA_AVX512 void load_sides(const IndexedCluster& cluster, const Point3* vertices, Sides& sides);
LAMINA_AVX512 void raise_tents(const Sides& sides, std::uint32_t shift, std::int32_t first, Tents& tents);
}  // namespace avx512
#endif

}  // namespace lamina::raster
