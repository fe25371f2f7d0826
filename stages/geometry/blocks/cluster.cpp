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

}  // namespace lamina
