#include "stages/geometry/blocks/cluster.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace lamina {
namespace {

#if defined(__SSE2__)

/// A vertex, and 4 bytes of the next one.
inline __m128i vertex_at(const Point3* vertices, std::uint16_t number) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(vertices + number));
}

/// The lowest or highest of each coordinate; SSE2 compares, but does not choose.
inline __m128i chosen(__m128i mask, __m128i yes, __m128i no) {
  return _mm_or_si128(_mm_and_si128(mask, yes), _mm_andnot_si128(mask, no));
}
inline __m128i lower(__m128i a, __m128i b) { return chosen(_mm_cmplt_epi32(a, b), a, b); }
inline __m128i higher(__m128i a, __m128i b) { return chosen(_mm_cmpgt_epi32(a, b), a, b); }

inline Point3 point_of(__m128i xyz) {
  Nm coordinate[4];
  _mm_storeu_si128(reinterpret_cast<__m128i*>(coordinate), xyz);
  return {coordinate[0], coordinate[1], coordinate[2]};
}

/// Four vertices, turned from rows into columns.
inline void expand_four(const std::uint16_t* corner, const Point3* vertices, Nm* x, Nm* y, Nm* z) {
  const __m128i a = vertex_at(vertices, corner[0]), b = vertex_at(vertices, corner[1]);
  const __m128i c = vertex_at(vertices, corner[2]), d = vertex_at(vertices, corner[3]);
  const __m128i xy_ab = _mm_unpacklo_epi32(a, b), xy_cd = _mm_unpacklo_epi32(c, d);
  const __m128i z_ab = _mm_unpackhi_epi32(a, b), z_cd = _mm_unpackhi_epi32(c, d);
  _mm_store_si128(reinterpret_cast<__m128i*>(x), _mm_unpacklo_epi64(xy_ab, xy_cd));
  _mm_store_si128(reinterpret_cast<__m128i*>(y), _mm_unpackhi_epi64(xy_ab, xy_cd));
  _mm_store_si128(reinterpret_cast<__m128i*>(z), _mm_unpacklo_epi64(z_ab, z_cd));
}

#else

inline void expand_four(const std::uint16_t* corner, const Point3* vertices, Nm* x, Nm* y, Nm* z) {
  for (std::uint32_t i = 0; i < 4; ++i) {
    const Point3& vertex = vertices[corner[i]];
    x[i] = vertex.x;
    y[i] = vertex.y;
    z[i] = vertex.z;
  }
}

#endif

}  // namespace

void expand_cluster(const IndexedCluster& from, const Point3* vertices, Cluster& out) {
  for (std::uint32_t k = 0; k < 3; ++k) {
    for (std::uint32_t i = 0; i < kClusterSize; i += 4) {
      expand_four(from.corner[k] + i, vertices, out.x[k] + i, out.y[k] + i, out.z[k] + i);
    }
  }
}

Box bounds_of(const IndexedCluster& cluster, const Point3* vertices) {
#if defined(__SSE2__)
  __m128i lo = vertex_at(vertices, cluster.corner[0][0]), hi = lo;
  for (const auto& corner : cluster.corner) {
    for (const std::uint16_t number : corner) {
      const __m128i vertex = vertex_at(vertices, number);
      lo = lower(vertex, lo);
      hi = higher(vertex, hi);
    }
  }
  return {point_of(lo), point_of(hi)};
#else
  Box box;
  for (const auto& corner : cluster.corner) {
    for (const std::uint16_t number : corner) box.add(vertices[number]);
  }
  return box;
#endif
}

Box bounds_of(const Cluster& cluster) {
  Box box;
  for (std::uint32_t k = 0; k < 3; ++k) {
    for (std::uint32_t i = 0; i < kClusterSize; ++i) box.add(Point3{cluster.x[k][i], cluster.y[k][i], cluster.z[k][i]});
  }
  return box;
}

}  // namespace lamina
