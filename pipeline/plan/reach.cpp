#include "pipeline/plan/reach.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/program/reach.h"

namespace lamina::pipeline {

Status check_reach(const Job& job, const Scene& scene) {
  if (!job.machine.resolved) return {};
  const Machine& machine = job.machine.resolved->machine;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const Mesh& mesh = scene.meshes[instance.mesh];
    const auto outside = program::first_outside(machine, mesh, instance.offset);
    if (!outside) continue;
    const std::string& part = scene.parts[scene.part_of_instance[i]].path;
    if (outside->above) {
      return Error{Fault::kUsage, fmt::format("{}: reaches z {:.3f} mm at x {:.3f}, y {:.3f}, above the build height of {}, "
                                              "{:g} mm; turn or scale the part",
                                              part, mm(outside->place.z), mm(outside->place.x), mm(outside->place.y),
                                              machine.name, machine.bed.build_height_mm)};
    }
    return Error{
        Fault::kUsage,
        fmt::format("{}: reaches x {:.3f}, y {:.3f} mm at z {:.3f}, {:.3f} mm outside of the bed of {}; "
                    "move, turn or scale the part",
                    part, mm(outside->place.x), mm(outside->place.y), mm(outside->place.z), outside->beyond_mm, machine.name)};
  }
  return {};
}

Result<std::string> check_build_steps(const Job& job, const heights::LayerTable& table) {
  if (!job.machine.resolved) return std::string();
  const Machine& machine = job.machine.resolved->machine;
  const std::int64_t step = std::max<std::int64_t>(1, std::llround(machine.motion.layer_step_um * 1000));
  std::uint32_t off = 0, first = 0;
  std::int64_t most = 0;
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    const Layer layer = table[i];
    if (layer.thickness < step) {
      return Error{Fault::kUsage, fmt::format("layer {}: {:g} mm is less than a step of {}, {:g} mm; use thicker layers", i,
                                              mm(layer.thickness), machine.name, mm(step))};
    }
    const std::int64_t over = (std::int64_t{layer.bottom} + layer.thickness) % step;
    if (over == 0) continue;
    if (off++ == 0) first = i;
    most = std::max(most, std::min(over, step - over));
  }
  if (off == 0) return std::string();
  return fmt::format(
      "{} of {} layers, first {}, end beside the {:g} mm steps of {}'s build vat, by up to {:g} mm, and cannot end "
      "there on the machine; thicknesses that are whole steps can",
      off, table.size(), first, mm(step), machine.name, mm(most));
}

}  // namespace lamina::pipeline
