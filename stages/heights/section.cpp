#include "stages/heights/section.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "stages/heights/steepest.h"

namespace lamina::heights {

Buffer<double> section_at_rungs(const SurfaceIndex& index, const Ladder& ladder, Nm tolerance) {
  Buffer<double> section = projected_below(index, index.parts, ladder, Sign::kUpMinusDown);
  std::vector<std::pair<std::int64_t, double>> faces;  // horizontal ones change the section at once
  for (const PartSurface& part : index.parts) {
    for (const Standing& standing : part.standing) {
      for (const FlatFacet& flat : index.meshes[standing.mesh].flats) {
        faces.emplace_back(std::int64_t{flat.height} + standing.raise, (flat.up ? flat.mm2 : -flat.mm2) * standing.copies);
      }
    }
  }
  std::ranges::stable_sort(faces, {}, &std::pair<std::int64_t, double>::first);
  double flat = 0;
  std::size_t next = 0;
  for (std::uint32_t rung = 0; rung < ladder.rungs(); ++rung) {
    for (; next < faces.size() && faces[next].first <= ladder[rung] + tolerance; ++next) flat += faces[next].second;
    section[rung] = std::max(0.0, -flat - section[rung]);
  }
  return section;
}

}  // namespace lamina::heights
