#include "stages/load/stl_facets.h"

#include <algorithm>
#include <cstring>

#include "stages/geometry/isa.h"
#include "stages/load/kernels/kernels.h"

namespace lamina::load {
namespace {

bool snap_transformed(const char* facets, std::size_t count, const Snapper& snapper, Triangle* out, Box& box) {
  for (std::size_t i = 0; i < count; ++i) {
    if (snap_facet(facets + i * kFacetBytes, snapper, out[i]) != Snapped::kYes) return false;
    box.add(out[i].a);
    box.add(out[i].b);
    box.add(out[i].c);
  }
  return true;
}

/// The bounds of a file in plain millimetres, in nm.
Box snapped_box(const CoordinateBox& from, const Snapper& snapper) {
  Box box;
  if (from.lo[0] > from.hi[0]) return box;
  for (const auto& corner : {from.lo, from.hi}) {
    Point3 at{};
    snapper.snap(static_cast<double>(corner[0]), static_cast<double>(corner[1]), static_cast<double>(corner[2]), at);
    box.add(at);
  }
  return box;
}

}  // namespace

void FacetBox::add(const FacetBox& other) {
  for (std::size_t k = 0; k < 3; ++k) {
    plain.lo[k] = std::min(plain.lo[k], other.plain.lo[k]);
    plain.hi[k] = std::max(plain.hi[k], other.plain.hi[k]);
  }
  transformed.add(other.transformed);
}

Box FacetBox::nm(const Snapper& snapper) const { return is_plain(snapper) ? snapped_box(plain, snapper) : transformed; }

Snapped snap_facet(const char* facet, const Snapper& snapper, Triangle& out) {
  std::array<float, 9> corner;
  std::memcpy(corner.data(), facet + 12, 36);
  Triangle triangle{};
  const std::array<Point3*, 3> points =
      snapper.mirrors() ? std::array{&triangle.a, &triangle.c, &triangle.b} : std::array{&triangle.a, &triangle.b, &triangle.c};
  for (std::size_t i = 0; i < 3; ++i) {
    const Snapped snapped = snapper.snap(static_cast<double>(corner[3 * i]), static_cast<double>(corner[3 * i + 1]),
                                         static_cast<double>(corner[3 * i + 2]), *points[i]);
    if (snapped != Snapped::kYes) return snapped;
  }
  out = triangle;
  return Snapped::kYes;
}

bool snap_facets(const char* facets, std::size_t count, const Snapper& snapper, Isa isa, Triangle* out, FacetBox& box) {
  return is_plain(snapper) ? load_kernels_for(isa_at_most(isa)).snap(facets, count, out, box.plain)
                           : snap_transformed(facets, count, snapper, out, box.transformed);
}

}  // namespace lamina::load
