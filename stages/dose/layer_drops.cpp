#include "stages/dose/layer_drops.h"

#include <algorithm>
#include <utility>

namespace lamina::dose {

std::uint64_t DropWork::bytes() const {
  std::uint64_t total = shares.bytes() + zones.bytes() + levels.bytes();
  for (const Runs& plane : planes) total += bytes_held(plane.row_offset) + bytes_held(plane.change);
  return total;
}

Difference take_half(std::uint8_t full, Runs& image, Runs& second, const DropWork& work) {
  at_least(work.shares, half_of(full), second);
  const Difference found = difference(image, second);
  std::swap(image, second);
  return found;
}

ZoneSums drops_of_layer(const DropRules& rules, const LayerDose& dose, std::uint32_t layer, Runs& image, Runs& second,
                        DropWork& work) {
  const std::uint8_t full = std::max<std::uint8_t>(1, rules.full);
  if (rules.full == 0) levels_of(image, 1, work.shares);
  if (dose.asked_shell == dose.asked_inside) {
    std::swap(work.shares, work.zones);
  } else {
    if (rules.shell.half_width.empty()) {
      at_least(work.shares, 1, second);
    } else {
      erode(image, rules.shell, second);
    }
    mark_core(work.shares, second, full, work.zones);
  }
  std::vector<Drops24> drops(std::size_t{2} * full + 1);
  drops_of_zones(dose, full, rules.dithered, drops);
  dither(work.zones, drops, layer, work.dither, work.levels);
  work.planes.resize(rules.most_drops);
  for (std::uint32_t drop = 0; drop < rules.most_drops; ++drop) {
    at_least(work.levels, static_cast<std::uint8_t>(drop + 1), work.planes[drop]);
  }
  image.row_offset = work.planes[0].row_offset;
  image.change = work.planes[0].change;
  return sums_of(work.zones, full, dose);
}

}  // namespace lamina::dose
