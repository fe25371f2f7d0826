#include "stages/coverage/meet/facet_group.h"

#include <algorithm>
#include <cmath>

#include "stages/coverage/meet/triangles_meet.h"
#include "stages/geometry/targets.h"

namespace lamina::coverage {
namespace {

/// Roundings of a plane's value: two of each coordinate of its normal, one of a difference, one of a product, three of sums;
/// each at most 2^-24 of the normal's longest coordinate times the distance.
constexpr float kPlaneMargin = 0x1p-20F;

}  // namespace

BoxLanes::BoxLanes() {
  std::fill_n(&low[0][0], 3 * kGroupSize, INT32_MAX);
  std::fill_n(&high[0][0], 3 * kGroupSize, INT32_MIN);
}

void BoxLanes::set(std::uint32_t lane, const Box& of) {
  low[0][lane] = of.lo.x, low[1][lane] = of.lo.y, low[2][lane] = of.lo.z;
  high[0][lane] = of.hi.x, high[1][lane] = of.hi.y, high[2][lane] = of.hi.z;
}

void FacetGroup::start() {
  used = 0;
  box = BoxLanes();
}

void FacetGroup::add(const Triangle& t, std::uint32_t its_number) {
  const std::uint32_t lane = used++;
  const Point3* const p[3] = {&t.a, &t.b, &t.c};
  Box around;
  for (std::uint32_t k = 0; k < 3; ++k) {
    corner[k][0][lane] = p[k]->x, corner[k][1][lane] = p[k]->y, corner[k][2][lane] = p[k]->z;
    around.add(*p[k]);
  }
  box.set(lane, around);
  number[lane] = its_number;
  const Plane plane(t);
  const double n[3] = {static_cast<double>(plane.nx), static_cast<double>(plane.ny), static_cast<double>(plane.nz)};
  const auto put = [&](std::uint32_t which, double x, double y, double z) {
    normal[which][0][lane] = static_cast<float>(x);
    normal[which][1][lane] = static_cast<float>(y);
    normal[which][2][lane] = static_cast<float>(z);
    slack[which][lane] = kPlaneMargin * static_cast<float>(std::max({std::abs(x), std::abs(y), std::abs(z)}));
  };
  put(0, n[0], n[1], n[2]);
  for (std::uint32_t k = 0; k < 3; ++k) {
    const Point3 &from = *p[k], &to = *p[(k + 1) % 3];
    const auto ex = static_cast<double>(std::int64_t{to.x} - from.x), ey = static_cast<double>(std::int64_t{to.y} - from.y),
               ez = static_cast<double>(std::int64_t{to.z} - from.z);
    put(k + 1, ey * n[2] - ez * n[1], ez * n[0] - ex * n[2], ex * n[1] - ey * n[0]);
  }
  const auto ex = static_cast<double>(std::int64_t{t.b.x} - t.a.x), ey = static_cast<double>(std::int64_t{t.b.y} - t.a.y),
             ez = static_cast<double>(std::int64_t{t.b.z} - t.a.z);
  const double fx = normal[2][0][lane], fy = normal[2][1][lane], fz = normal[2][2][lane];
  offset[lane] = static_cast<float>(fx * ex + fy * ey + fz * ez);
  reach[lane] = static_cast<float>(std::abs(ex) + std::abs(ey) + std::abs(ez));
}

Triangle FacetGroup::facet(std::uint32_t lane) const {
  const auto point = [&](std::uint32_t k) { return Point3{corner[k][0][lane], corner[k][1][lane], corner[k][2][lane]}; };
  return {point(0), point(1), point(2)};
}

const PairKernels& pair_kernels_for([[maybe_unused]] Isa isa) {
  static constexpr PairKernels kPlain{plain::touching, plain::pairs};
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr PairKernels kAvx2{avx2::touching, avx2::pairs}, kAvx512{avx512::touching, avx512::pairs};
  if (isa == Isa::kAvx512) return kAvx512;
  if (isa == Isa::kAvx2) return kAvx2;
#endif
  return kPlain;
}

}  // namespace lamina::coverage
