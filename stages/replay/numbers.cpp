// What a program says of its layer and of its sweeps, against the layer and where the sweeps are.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/replay/printing.h"

namespace lamina::replay {

void Printing::tells_layers(std::uint32_t layers) {
  if (machine_.layers_ == 0 || layers == machine_.layers_) return;
  fault(fmt::format("the program is of {} layers, the job has {}", layers, machine_.layers_));
}

void Printing::tells_heights(std::optional<double> bottom_mm, double thickness_mm) {
  const double bottom = mm(layer_.bottom), thickness = mm(layer_.thickness);
  if (std::abs(thickness_mm - thickness) > 1e-4) {
    wrong_powder(fmt::format("it is told to be {:g} mm thick where {:g} have to be", thickness_mm, thickness));
  } else if (bottom_mm && std::abs(*bottom_mm - bottom) > 1e-4) {
    wrong_powder(fmt::format("it is told to begin at {:g} mm where {:g} have to be", *bottom_mm, bottom));
  }
}

void Printing::tells_sweep(std::uint32_t of) {
  if (backward_ && !profile().motion.both_directions) fault("runs back, and the profile's head fires on the way there alone");
  if (told_of_ && *told_of_ != of) fault(fmt::format("is one of {} swaths, those before of {}", of, *told_of_));
  told_of_ = of;
}

// The first line of the layer that has something; the last one if none has.
std::int64_t Printing::first_of_layer(const RunsView& image) const {
  std::int64_t first = machine_.lines_ - 1;
  for (std::uint32_t row = 0; row < image.rows(); ++row) {
    const auto line = image.row(row);
    if (!line.empty()) first = std::min({first, line_of(line.front(), row), line_of(line.back() - 1, row)});
  }
  return first;
}

// Numbers follow from where sweeps begin: a swath after the other, of each its passes, of each the sweeps for its drops.
void Printing::check_numbers(std::span<const RunsView> planes) {
  if (!told_of_) return;
  const auto& mount = profile().mounting;
  const std::int64_t lines = std::int64_t{nozzles()} * mount.passes, stride = lines - mount.overlap_lines;
  std::int64_t first = mount.first_swath == FirstSwath::kLayer ? first_of_layer(planes[0]) : 0;
  first -= static_cast<std::int64_t>(layer_.index) * mount.joint_shift_lines % stride;
  const std::int64_t left = machine_.lines_ - first;
  const std::int64_t swaths = left <= lines ? 1 : 1 + (left - lines + stride - 1) / stride;
  const std::int64_t a_place = sweeps_a_place(), of = swaths * mount.passes * a_place;
  if (*told_of_ != of)
    return fail(
        fmt::format("layer {}, before its first swath: is told to have {} swaths, and has {}", layer_.index, *told_of_, of));
  const bool further = profile().head.blocked_rule == BlockedRule::kSecondPass && !profile().head.blocked.empty();
  for (const Sweep& sweep : sweeps_) {
    if (sweep.number >= of) {
      if (further) continue;
      return fail(fmt::format("layer {}, swath {}, before its first step: is beyond the {} that the layer has", layer_.index,
                              sweep.number, of));
    }
    const std::int64_t place = sweep.number / a_place, at = first + place / mount.passes * stride + place % mount.passes;
    if (sweep.first_line == at) continue;
    return fail(
        fmt::format("layer {}, swath {}, before its first step: begins at line {}, and the swath of that number at line {}",
                    layer_.index, sweep.number, sweep.first_line, at));
  }
}

}  // namespace lamina::replay
