// stages/raster/kernels/bodies.h: the bodies themselves, and what they share. Those of an instruction set are functions with
// that target, so that the rest of the program runs on any processor.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "stages/raster/kernels/kernels.h"

#if defined(__x86_64__)
#define LAMINA_WIDE_KERNELS 1
#define LAMINA_AVX2 __attribute__((target("avx2,bmi,bmi2,popcnt")))
#define LAMINA_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,bmi,bmi2,popcnt")))
#endif

namespace lamina::raster {

/// Slopes beyond this are left to integers. Below it a guess is off by less than 0.02 nm: ends are known to 2^-20 nm, which
/// the slope multiplies, and the slope to 2^-51 of itself, over less than 2^31 nm; products of both are below 2^43 nm.
inline constexpr double kSteepest = 4096;

/// The plane in the frame of a mesh, where corners lie; one out of reach of any corner cuts nothing.
inline Nm plane_in_mesh(Nm plane, const Point3& offset) {
  constexpr std::int64_t kLeast = std::numeric_limits<Nm>::min(), kMost = std::numeric_limits<Nm>::max();
  return static_cast<Nm>(std::clamp(std::int64_t{plane} - offset.z, kLeast, kMost));
}

/// The first row at or beyond the point in which the plane meets an edge of facet i, decided in integers.
std::uint32_t exact_end(const PixelSampling& sampling, const CutFacets& facets, const CutFacets::Corner& other, std::uint32_t i,
                        Nm plane);

/// The crossing of a segment with a row, decided in integers.
std::uint32_t exact_crossing(const FillTask& task, std::size_t segment, std::uint32_t row);

/// Writes the crossings of the first four of `left` rows of a segment, or of all, and no branch depends on how many: what is
/// too much goes to the unused crossing.
inline void put_four(const FillTask& task, std::uint32_t* place, std::uint32_t left, const std::uint32_t* value) {
  static constexpr std::uint32_t kIsRow[5][4] = {{0, 0, 0, 0},
                                                 {UINT32_MAX, 0, 0, 0},
                                                 {UINT32_MAX, UINT32_MAX, 0, 0},
                                                 {UINT32_MAX, UINT32_MAX, UINT32_MAX, 0},
                                                 {UINT32_MAX, UINT32_MAX, UINT32_MAX, UINT32_MAX}};
  const std::uint32_t* const is_row = kIsRow[std::min(left, 4u)];
  for (std::uint32_t k = 0; k < 4; ++k) {
    const std::uint32_t at = place[k];
    place[k] = at - is_row[k];
    task.crossing[task.unused ^ ((task.unused ^ at) & is_row[k])] = value[k];
  }
}

/// Writes all crossings of an upright segment, which have one column, or of one that is exact in every row.
void fill_exactly(const FillTask& task, std::size_t segment);

/// Writes the changes of a row whose crossings are sorted behind `change`, by any rule; they may be the crossings' own places.
/// returns  their end
std::uint32_t* write_changes(FillRule rule, const std::uint32_t* crossing, const std::uint32_t* end, std::uint32_t* change);

namespace plain {
void gather(const ClusterSource& source, Nm plane, CutFacets& facets);
void cut(const PixelSampling& sampling, CutFacets& facets, Nm plane, std::uint32_t row_begin, std::uint32_t row_end,
         Segments& out);
void fill(const FillTask& task);
std::uint32_t* rows(const RowsTask& task);
}  // namespace plain

#if defined(LAMINA_WIDE_KERNELS)
namespace avx2 {
LAMINA_AVX2 void gather(const ClusterSource& source, Nm plane, CutFacets& facets);
LAMINA_AVX2 void cut(const PixelSampling& sampling, CutFacets& facets, Nm plane, std::uint32_t row_begin, std::uint32_t row_end,
                     Segments& out);
LAMINA_AVX2 void fill(const FillTask& task);
LAMINA_AVX2 std::uint32_t* rows(const RowsTask& task);
}  // namespace avx2

namespace avx512 {
LAMINA_AVX512 void gather(const ClusterSource& source, Nm plane, CutFacets& facets);
LAMINA_AVX512 void cut(const PixelSampling& sampling, CutFacets& facets, Nm plane, std::uint32_t row_begin,
                       std::uint32_t row_end, Segments& out);
LAMINA_AVX512 std::uint32_t* rows(const RowsTask& task);
}  // namespace avx512
#endif

}  // namespace lamina::raster
