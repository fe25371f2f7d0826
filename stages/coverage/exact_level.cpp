#include "stages/coverage/exact_level.h"

#include <gmpxx.h>

#include <algorithm>

#include "stages/coverage/slab_facet.h"

namespace lamina::coverage {
namespace {

mpq_class rational(std::int64_t whole) { return mpq_class(static_cast<long>(whole)); }

/// Volume of the voxel that lies behind the facet, nm^3; negative behind one where +x leaves the solid.
mpq_class volume_behind(const Triangle& facet, const Voxel& voxel) {
  Piece<mpq_class> one, other;
  for (const Point3* p : {&facet.a, &facet.b, &facet.c}) {
    one.corner[one.size++] = {rational(p->x - voxel.x0), rational(p->y - voxel.y0), rational(p->z - voxel.z0)};
  }
  const mpq_class zero, depth = rational(voxel.y1 - voxel.y0), height = rational(voxel.z1 - voxel.z0);
  cut<&Corner<mpq_class>::z, true>(one, zero, other);
  cut<&Corner<mpq_class>::z, false>(other, height, one);
  cut<&Corner<mpq_class>::y, true>(one, zero, other);
  cut<&Corner<mpq_class>::y, false>(other, depth, one);
  const mpq_class width = rational(voxel.x1 - voxel.x0);
  mpq_class sum;
  for (std::uint32_t k = 1; k + 1 < one.size; ++k) {
    const Tent<mpq_class> tent(one.corner[0], one.corner[k], one.corner[k + 1]);
    if (tent.x0 >= width) continue;
    if (tent.x2 <= zero) {
      sum += tent.area * width;
    } else {
      sum += tent.behind(width) - tent.behind(zero);
    }
  }
  return sum;
}

}  // namespace

std::uint32_t exact_level(const Voxel& voxel, std::int64_t winding, std::span<const SlabFacet> facets,
                          std::span<const RowFacet> span, std::uint32_t column, std::uint32_t top_level) {
  const mpq_class whole = rational(voxel.x1 - voxel.x0) * rational(voxel.y1 - voxel.y0) * rational(voxel.z1 - voxel.z0);
  mpq_class volume = rational(winding) * whole;
  for (const RowFacet& of_row : span) {
    const SlabFacet& facet = facets[of_row.index];
    if (facet.edgewise || of_row.first > column) continue;
    volume += volume_behind(facet.facet, voxel);
  }
  const mpq_class level = volume * static_cast<long>(top_level) / whole + mpq_class(1, 2);
  mpz_class below;
  mpz_fdiv_q(below.get_mpz_t(), level.get_num_mpz_t(), level.get_den_mpz_t());
  if (below < 0) return 0;
  return below > top_level ? top_level : static_cast<std::uint32_t>(below.get_ui());
}

}  // namespace lamina::coverage
