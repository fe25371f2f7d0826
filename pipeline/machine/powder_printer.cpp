#include "pipeline/machine/powder_printer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/machine/printer_profile.h"
#include "stages/program/head_grid.h"
#include "stages/program/reach.h"
#include "stages/write/program/dialect.h"

namespace lamina::pipeline {
namespace {

Error wrong(const std::string& key, const std::string& what) { return {Fault::kUsage, fmt::format("{}: {}", key, what)}; }

/// Changes a machine so that it prints at the asked dpi, if its head can.
Status ask_for_dpi(Machine& machine, const HeadGrid& grid, const std::array<std::int64_t, 2>& dpi) {
  const bool scan_x = machine.mounting.scan_axis == ScanAxis::kX;
  const auto across = static_cast<double>(dpi[scan_x ? 1 : 0]), along = static_cast<double>(dpi[scan_x ? 0 : 1]);
  const double head = kNmPerInch / (grid.line_nm * grid.passes);
  const double passes = std::round(across / head);
  // The last nozzle may be a quarter of a pixel off.
  if (passes < 1 || passes > 64 || std::abs(across / head - passes) * grid.nozzles > 0.25) {
    return wrong("bed.dpi", fmt::format("{:g} dpi across the scan: the head of {} reaches {:.2f} and its multiples; change the "
                                        "tilt or the asked dpi",
                                        across, machine.name, head));
  }
  machine.mounting.passes = static_cast<std::uint32_t>(passes);
  if (machine.mounting.dpi != 0) machine.mounting.dpi = std::round(head * passes * 1e6) / 1e6;
  const double square = kNmPerInch / grid.line_nm * passes / grid.passes;
  if (machine.motion.ticks_per_pixel > 0) {
    const double ticks = std::round(machine.motion.encoder_dpi / along);
    if (ticks < 1 || std::abs(machine.motion.encoder_dpi / ticks - along) > 0.5) {
      return wrong("bed.dpi", fmt::format("{:g} dpi along the scan: the encoder of {} has {:g} ticks an inch; ask for a "
                                          "whole fraction of it",
                                          along, machine.name, machine.motion.encoder_dpi));
    }
    machine.motion.ticks_per_pixel = static_cast<std::uint32_t>(ticks);
  } else if (std::abs(along - square) > 0.5) {
    machine.mounting.along_dpi = along;
  } else {
    machine.mounting.along_dpi = 0;
  }
  return {};
}

}  // namespace

Result<ResolvedMachine> resolve_profile(const Machine& machine) {
  auto grid = program::make_head_grid(machine);
  if (!grid) return grid.error();
  const write::Dialect* dialect = write::find_dialect(machine.dialect);
  if (dialect == nullptr) return wrong("machine.dialect", fmt::format("there is no dialect '{}'", machine.dialect));
  if (Status status = write::check_dialect(*dialect, machine, *grid); !status) return status.error();
  grid->bit_order = dialect->bit_order;
  if (!machine.powder.materials.empty() && machine.powder.materials.size() != machine.powder.vats) {
    return wrong("powder.materials", fmt::format("{} names for {} vats of {}; name what is in each",
                                                 machine.powder.materials.size(), machine.powder.vats, machine.name));
  }
  return ResolvedMachine{machine, std::move(*grid)};
}

Status resolve_machine(Job& job) {
  MachineRequest& request = job.machine;
  request.resolved.reset();
  if (request.profile.empty()) {
    if (request.scan_speed_mm_s || request.blocked) return wrong("machine.profile", "is missing; name one with --machine");
    return {};
  }
  Result<Machine> found = find_machine(request.profile);
  if (!found) return found.error();
  Machine machine = std::move(*found);
  if (request.scan_speed_mm_s) machine.motion.scan_speed_mm_s = *request.scan_speed_mm_s;
  if (request.blocked) machine.head.blocked = *request.blocked;
  auto resolved = resolve_profile(machine);
  if (!resolved) return resolved.error();
  if (request.dpi_given) {
    if (Status status = ask_for_dpi(machine, resolved->grid, job.dpi); !status) return status;
    resolved = resolve_profile(machine);
    if (!resolved) return resolved.error();
  }
  if (request.bed_given && job.bed_mm != machine.bed.size_mm) {
    return wrong("bed.size_mm", fmt::format("the bed of {} is {:g} x {:g} mm; leave it out or change the profile", machine.name,
                                            machine.bed.size_mm[0], machine.bed.size_mm[1]));
  }
  job.bed_mm = machine.bed.size_mm;
  job.machine.decides_bed = true;
  request.resolved = std::make_shared<const ResolvedMachine>(std::move(*resolved));
  return {};
}

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
