#include "stages/replay/jetting.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

namespace lamina::replay {
namespace {

struct SweepCheck {
  std::int64_t first_line;
  std::uint32_t first_step, last_step;
  bool backward;
};

/// How many fell on each pixel; 255 stand for more.
Levels levels_of_drops(std::vector<VirtualMachine::Drop>& drops, std::uint32_t columns, std::uint32_t rows) {
  const auto position = [](const VirtualMachine::Drop& drop) { return std::pair(drop.row, drop.column); };
  std::ranges::sort(drops, {}, position);
  Levels levels;
  levels.start(columns);
  auto next = drops.begin();
  for (std::uint32_t row = 0; row < rows; ++row) {
    while (next != drops.end() && next->row == row) {
      const std::uint32_t column = next->column;
      const auto end =
          std::find_if(next, drops.end(), [&](const auto& drop) { return position(drop) != std::pair(row, column); });
      levels.append(column, column + 1, static_cast<std::uint8_t>(std::min<std::ptrdiff_t>(end - next, 255)));
      next = end;
    }
    levels.end_row();
  }
  return levels;
}

/// A layer's program carried out, and what is looked at.
struct Carried {
  std::vector<VirtualMachine::Drop> drops;  // in the order of the program
  std::map<std::uint32_t, SweepCheck> sweeps;
  std::vector<std::uint32_t> order;   // of the sweeps that fire
  std::uint32_t swath = 0, step = 0;  // what is chosen of them

  const SweepCheck& present() const { return sweeps.at(swath); }
  /// Those of earlier sweeps, and of this one up to the step.
  std::vector<VirtualMachine::Drop> fired() const {
    std::vector<VirtualMachine::Drop> so_far;
    bool here = false;
    for (const VirtualMachine::Drop& drop : drops) {
      here = here || drop.sweep == swath;
      if (here && (drop.sweep != swath || (present().backward ? drop.step < step : drop.step > step))) break;
      so_far.push_back(drop);
    }
    return so_far;
  }
};

Result<Carried> carry_out(const VirtualMachine& machine, std::string_view program, const StepChoice& choice) {
  Carried carried;
  const auto replayed = machine.run(
      program, choice.layer,
      [&](const VirtualMachine::Drop& drop) {
        carried.drops.push_back(drop);
        const auto [found, fresh] =
            carried.sweeps.try_emplace(drop.sweep, SweepCheck{drop.first_line, drop.step, drop.step, false});
        if (fresh) carried.order.push_back(drop.sweep);
        found->second.first_step = std::min(found->second.first_step, drop.step);
        found->second.last_step = std::max(found->second.last_step, drop.step);
        if (drop.step < found->second.last_step) found->second.backward = true;
      },
      choice.planes);
  if (!replayed) return replayed.error();
  if (carried.order.empty())
    return Error{Fault::kUsage, fmt::format("layer {}: its program fires nothing; choose another --layer", choice.layer)};
  const std::uint32_t swath = carried.swath = choice.swath.value_or(carried.order[carried.order.size() / 2]);
  if (!carried.sweeps.contains(swath)) {
    return Error{Fault::kUsage, fmt::format("--swath {}: fires nothing in layer {}; those that do are {} to {}", swath,
                                            choice.layer, carried.sweeps.begin()->first, carried.sweeps.rbegin()->first)};
  }
  const auto [line, first, last, backward] = carried.present();
  if (choice.step && (*choice.step < first || *choice.step > last)) {
    return Error{Fault::kUsage, fmt::format("--step {}: swath {} of layer {} fires at steps {} to {}", *choice.step, swath,
                                            choice.layer, first, last)};
  }
  carried.step = choice.step.value_or(first + (last - first) / 2);
  return carried;
}

/// Where the sweeps pass: from the line of the first to that of the last nozzle, wherever they lie on the bed.
std::vector<SwathBand> bands_of(const Carried& carried, const VirtualMachine& machine, const PixelGrid& grid) {
  const bool x = machine.profile().mounting.scan_axis == ScanAxis::kX;
  const std::uint32_t last = machine.profile().head.nozzles - 1;
  std::vector<SwathBand> bands;
  for (const auto& [number, sweep] : carried.sweeps) {
    const auto one = machine.nozzle_at(sweep.first_line, 0, 0), other = machine.nozzle_at(sweep.first_line, 0, last);
    const double lo = std::min(one[x ? 1 : 0], other[x ? 1 : 0]), hi = std::max(one[x ? 1 : 0], other[x ? 1 : 0]) + 1;
    bands.push_back(x ? SwathBand{0, double(grid.columns()), lo, hi, number == carried.swath}
                      : SwathBand{lo, hi, 0, double(grid.rows()), number == carried.swath});
  }
  return bands;
}

}  // namespace

Result<Jetting> jet_until(const VirtualMachine& machine, std::string_view program, const StepChoice& choice,
                          const PixelGrid& grid) {
  const auto carried = carry_out(machine, program, choice);
  if (!carried) return carried.error();
  const auto& [drops, sweeps, order, swath, step] = *carried;
  std::vector<VirtualMachine::Drop> fired = carried->fired();
  Jetting jetting;
  jetting.swath = swath;
  jetting.step = step;
  jetting.position = static_cast<std::size_t>(std::ranges::find(order, swath) - order.begin()) + 1;
  jetting.sweeps = order.size();
  jetting.fired = fired.size();
  jetting.drops = drops.size();
  jetting.printed = levels_of_drops(fired, grid.columns(), grid.rows());
  jetting.bands = bands_of(*carried, machine, grid);
  std::vector<bool> fires(machine.profile().head.nozzles, false);
  for (const VirtualMachine::Drop& drop : drops) {
    if (drop.sweep == swath && drop.step == step) fires[drop.nozzle] = true;
  }
  jetting.firing = static_cast<std::size_t>(std::ranges::count(fires, true));
  for (std::uint32_t i = 0; i < fires.size(); ++i) {
    const auto at = machine.nozzle_at(carried->present().first_line, step, i);
    jetting.nozzles.push_back({at[0], at[1], fires[i]});
  }
  return jetting;
}

}  // namespace lamina::replay
