// stages/load/repair/facts.cpp: which way round a mesh is, and how much of it repair added.
#include <algorithm>

#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"
#include "stages/load/repair/repair.h"

namespace lamina::load {

bool turn_over_if_inside_out(Mesh& mesh) {
  if (!mesh.closed || mesh.volume_mm3 >= 0) return false;
  for (Triangle& t : mesh.triangles) std::swap(t.b, t.c);
  const Census found = census(mesh.triangles, mesh.bounds.middle().z);
  mesh.fingerprint = found.fingerprint;
  mesh.volume_mm3 = found.volume_mm3;
  return true;
}

double capped_share(const Mesh& mesh) {
  const std::size_t count = mesh.triangles.size(), own = std::min<std::size_t>(mesh.repaired_from, count);
  if (own == count) return 0;
  double area = 0, caps = 0;
  for (std::size_t i = 0; i < count; ++i) (i < own ? area : caps) += doubled_area_length(mesh.triangles[i]);
  return caps > 0 ? caps / (area + caps) : 0;
}

}  // namespace lamina::load
