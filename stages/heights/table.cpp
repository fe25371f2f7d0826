#include "stages/heights/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lamina::heights {

Result<std::string> check_build_steps(const Machine& machine, const LayerTable& table) {
  const std::int64_t step = std::max<std::int64_t>(1, std::llround(machine.motion.layer_step_um * 1000));
  std::uint32_t off = 0, first = 0;
  std::int64_t maximum = 0;
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    const Layer layer = table[i];
    if (layer.thickness < step) {
      return Error{Fault::kUsage, fmt::format("layer {}: {:g} mm is less than a step of {}, {:g} mm; use thicker layers", i,
                                              mm(layer.thickness), machine.name, mm(step))};
    }
    const std::int64_t over = (std::int64_t{layer.bottom} + layer.thickness) % step;
    if (over == 0) continue;
    if (off++ == 0) first = i;
    maximum = std::max(maximum, std::min(over, step - over));
  }
  if (off == 0) return std::string();
  return fmt::format(
      "{} of {} layers, first {}, end beside the {:g} mm steps of {}'s build vat, by up to {:g} mm, and cannot end "
      "there on the machine; thicknesses that are whole steps can",
      off, table.size(), first, mm(step), machine.name, mm(maximum));
}

}  // namespace lamina::heights
