#include "stages/heights/flats.h"

#include <algorithm>
#include <cstdlib>

namespace lamina::heights {
namespace {

struct Face {
  Nm height;
  std::uint32_t part;
  bool up, end;
  double mm2;
};

Flat flat_of(std::span<const Face> faces) {
  Flat flat{};
  double all = 0, below = 0, part_mm2 = 0, max_mm2 = -1;
  for (const Face& face : faces) {
    all += face.mm2;
    (face.up ? flat.up_mm2 : flat.down_mm2) += face.mm2;
    flat.end = flat.end || face.end;
  }
  flat.height = faces.front().height;
  for (const Face& face : faces) {
    below += face.mm2;
    if (2 * below >= all) {
      flat.height = face.height;
      break;
    }
  }
  // Dimensions of a part are measured between its ends, so an end decides; the highest one where there are several.
  for (const Face& face : faces) {
    if (face.end) flat.height = face.height;
  }
  std::vector<Face> by_part(faces.begin(), faces.end());
  std::ranges::stable_sort(by_part, {}, &Face::part);
  for (std::size_t i = 0; i < by_part.size(); ++i) {
    part_mm2 = i > 0 && by_part[i - 1].part == by_part[i].part ? part_mm2 + by_part[i].mm2 : by_part[i].mm2;
    if (part_mm2 > max_mm2) {
      max_mm2 = part_mm2;
      flat.part = by_part[i].part;
    }
  }
  return flat;
}

}  // namespace

std::vector<Flat> find_flats(const SurfaceIndex& index, Nm tolerance, double min_mm2) {
  std::vector<Face> faces;
  for (std::uint32_t part = 0; part < index.parts.size(); ++part) {
    const PartSurface& surface = index.parts[part];
    for (const PlacedSurface& placed : surface.placed) {
      for (const FlatFacet& flat : index.meshes[placed.mesh].flats) {
        faces.push_back({flat.height + placed.raise, part, flat.up, false, flat.mm2});
      }
    }
    faces.push_back({surface.bottom, part, false, true, 0});
    faces.push_back({surface.top, part, true, true, 0});
  }
  std::ranges::stable_sort(faces, {}, &Face::height);
  std::vector<Flat> flats;
  for (std::size_t first = 0, last = 0; first < faces.size(); first = last) {
    while (last < faces.size() && faces[last].height - faces[first].height <= tolerance) ++last;
    const Flat flat = flat_of(std::span(faces).subspan(first, last - first));
    if (flat.height > tolerance && (flat.end || flat.up_mm2 + flat.down_mm2 >= min_mm2)) flats.push_back(flat);
  }
  return flats;
}

std::int64_t distance_to_nearest(std::span<const std::int64_t> boundaries, std::int64_t height) {
  const auto above = std::ranges::lower_bound(boundaries, height);
  std::int64_t distance = INT64_MAX;
  if (above != boundaries.end()) distance = *above - height;
  if (above != boundaries.begin()) distance = std::min(distance, height - *(above - 1));
  return distance;
}

}  // namespace lamina::heights
