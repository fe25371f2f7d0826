#include "pipeline/manifest/record.h"

namespace lamina {

void PathFacts::add(const PathFacts& other) {
  contours += other.contours;
  points += other.points;
  paths += other.paths;
  merged += other.merged > 0 ? 1 : 0;
  open += other.open;
  area_mm2 += other.area_mm2;
  bead_mm += other.bead_mm;
  stored_points += other.stored_points;
  totals.add(other.totals);
  deposited.add(other.deposited);
}

std::vector<std::uint64_t> LayerRecord::pixels_of_materials(std::size_t materials) const {
  std::vector<std::uint64_t> pixels(materials);
  for (std::size_t m = 0; m < materials; ++m) pixels[m] = image_of(m, materials).set_pixels;
  return pixels;
}

std::uint64_t LayerRecord::drops_of(std::size_t material, std::size_t materials) const {
  const std::size_t each = images.size() / materials;
  std::uint64_t sum = 0;
  for (std::size_t i = material * each; i < (material + 1) * each; ++i)
    sum += images[i].drops > 0 ? images[i].drops : images[i].set_pixels;
  return sum;
}

}  // namespace lamina
