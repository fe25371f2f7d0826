#include "stages/heights/section.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "stages/heights/steepest.h"

namespace lamina::heights {

Buffer<double> section_at_candidates(const SurfaceIndex& index, const CandidateHeights& candidate_heights, Nm tolerance) {
  Buffer<double> section = projected_below(index, index.parts, candidate_heights, Sign::kUpMinusDown);
  std::vector<std::pair<std::int64_t, double>> faces;  // horizontal ones change the section at once
  for (const PartSurface& part : index.parts) {
    for (const PlacedSurface& placed : part.placed) {
      for (const FlatFacet& flat : index.meshes[placed.mesh].flats) {
        faces.emplace_back(std::int64_t{flat.height} + placed.raise, (flat.up ? flat.mm2 : -flat.mm2) * placed.copies);
      }
    }
  }
  std::ranges::stable_sort(faces, {}, &std::pair<std::int64_t, double>::first);
  double flat = 0;
  std::size_t next = 0;
  for (std::uint32_t candidate = 0; candidate < candidate_heights.candidates(); ++candidate) {
    for (; next < faces.size() && faces[next].first <= candidate_heights[candidate] + tolerance; ++next)
      flat += faces[next].second;
    section[candidate] = std::max(0.0, -flat - section[candidate]);
  }
  return section;
}

}  // namespace lamina::heights
