// stages/program/program_text.h: what text dialects have in common: axes, positions, numbers.
#pragma once

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>

#include "stages/data/units.h"
#include "stages/program/dialect.h"
#include "stages/support/text/number_text.h"

namespace lamina::program {

/// Appends formatted text to bytes.
template <class... Values>
void put(ProgramBytes& out, fmt::format_string<Values...> format, Values&&... values) {
  const std::string text = fmt::format(format, std::forward<Values>(values)...);
  const std::size_t at = out.size();
  out.resize(at + text.size());
  std::memcpy(out.data() + at, text.data(), text.size());
}

/// "machine: key: what".
inline Error wrong_key(const Machine& machine, std::string_view key, std::string_view what) {
  return {Fault::kUsage, fmt::format("{}: {}: {}", machine.name, key, what)};
}

/// Of the carriage, x and y in mm.
using MachinePoint = std::array<double, 2>;

/// A movement of the head, as "G0 X10 Y20 F3000".
inline void put_move(const Machine& machine, std::string_view command, MachinePoint to, double mm_s, ProgramBytes& out) {
  put(out, "{} {}{} {}{} F{}\n", command, machine.motion.x_axis, mm_text(to[0]), machine.motion.y_axis, mm_text(to[1]),
      feed_text(mm_s));
}

/// The bits of all nozzles that are not blocked, of a head of at most 31.
inline std::uint32_t working_nozzles(const Machine& machine) {
  std::uint32_t all = (std::uint32_t{1} << machine.head.nozzles) - 1;
  for (const std::uint32_t nozzle : machine.head.blocked) all &= ~(1u << nozzle);
  return all;
}

/// Positions of the carriage for sweeps, in mm.
class Carriage {
 public:
  Carriage(const Machine& machine, const HeadGrid& grid) : machine_(machine), grid_(grid) {}

  std::string_view scan_axis() const {
    return grid_.scan_axis == ScanAxis::kX ? machine_.motion.x_axis : machine_.motion.y_axis;
  }
  std::string_view line_axis() const {
    return grid_.scan_axis == ScanAxis::kX ? machine_.motion.y_axis : machine_.motion.x_axis;
  }
  double along(double step) const {
    return grid_.step_position_nm(step) / kNmPerMm + machine_.mounting.offset_mm[grid_.scan_axis == ScanAxis::kX ? 0 : 1];
  }
  double across(std::int64_t line) const {
    return grid_.line_position_nm(line) / kNmPerMm + machine_.mounting.offset_mm[grid_.scan_axis == ScanAxis::kX ? 1 : 0];
  }
  MachinePoint position(double along_mm, std::int64_t line) const {
    const double across_mm = across(line);
    return grid_.scan_axis == ScanAxis::kX ? MachinePoint{along_mm, across_mm} : MachinePoint{across_mm, along_mm};
  }
  /// Where a sweep's movement begins and ends: the ramp before its first and behind its last step.
  double begin(const Sweep& sweep, const SweepVectors& vectors) const { return end_of(vectors, sweep.backward); }
  double end(const Sweep& sweep, const SweepVectors& vectors) const { return end_of(vectors, !sweep.backward); }
  std::array<MachinePoint, 2> ends(const Sweep& sweep, const SweepVectors& vectors) const {
    return {position(begin(sweep, vectors), sweep.first_line), position(end(sweep, vectors), sweep.first_line)};
  }

 private:
  double end_of(const SweepVectors& vectors, bool last) const {
    const double ramp = machine_.motion.ramp_mm * (last == grid_.positions_from_end ? -1 : 1);
    return along(last ? vectors.first_step + vectors.steps - 1.0 : vectors.first_step) + ramp;
  }
  const Machine& machine_;
  const HeadGrid& grid_;
};

/// States the position of the build vat before a base of powder is spread: the first layer above it begins at 0. Nothing
/// without a base.
void put_base_zero(const Machine& machine, ProgramBytes& out);

/// Calls visit(bottom_nm, thickness_nm) for each spreading of a layer's powder, from the bottom up: those of the base before
/// the first layer, then the layer's own.
template <class Visit>
void for_each_spread(const Machine& machine, const LayerCycle& cycle, const Visit& visit) {
  const std::uint32_t below = cycle.layer == 0 ? machine.powder.base_layers : 0;
  const std::int64_t thickness = nm_of(machine.powder.base_layer_mm);
  for (std::uint32_t k = 0; k < below; ++k) visit(cycle.bottom_nm - (below - k) * thickness, thickness);
  visit(cycle.bottom_nm, cycle.thickness_nm);
}

/// The powder cycle before the head moves, as relative and absolute moves of G-code: the build vat goes to the depth of
/// the layer, the vats feed dose x thickness each, the roller spreads and returns. Before the first layer the base likewise.
void put_powder_cycle(const Machine& machine, const LayerCycle& cycle, ProgramBytes& out);

/// Calls visit(step, words) for the steps that fire, in the order of the movement.
template <class Visit>
void for_each_vector(const Sweep& sweep, const SweepVectors& vectors, const Visit& visit) {
  const auto& firing = vectors.firing;
  for (std::size_t i = 0; i < firing.size(); i += 2) {
    const std::size_t span = sweep.backward ? firing.size() - 2 - i : i;
    const std::uint32_t count = firing[span + 1] - firing[span];
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t position = firing[span] + (sweep.backward ? count - 1 - k : k);
      visit(vectors.first_step + position, vectors.bits.data() + std::size_t{position} * vectors.words);
    }
  }
}

}  // namespace lamina::program
