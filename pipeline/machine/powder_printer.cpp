#include "pipeline/machine/powder_printer.h"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/machine/printer_profile.h"
#include "stages/program/head_grid.h"
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

Result<PowderPrinter> resolve_powder_printer(const Job& job) {
  const MachineRequest& request = job.machine;
  if (request.profile.empty()) {
    if (request.scan_speed_mm_s || request.blocked) return wrong("machine.profile", "is missing; name one with --machine");
    return PowderPrinter{
        nullptr, job.bed_mm, {PixelAxis(job.dpi[0], nm_of(job.bed_mm[0])), PixelAxis(job.dpi[1], nm_of(job.bed_mm[1]))}};
  }
  Result<Machine> found = find_machine(request.profile);
  if (!found) return found.error();
  Machine machine = std::move(*found);
  if (request.scan_speed_mm_s) machine.motion.scan_speed_mm_s = *request.scan_speed_mm_s;
  if (request.blocked) machine.head.blocked = *request.blocked;
  auto resolved = resolve_profile(machine);
  if (!resolved) return resolved.error();
  if (request.dpi_given) {
    if (Status status = ask_for_dpi(machine, resolved->grid, job.dpi); !status) return status.error();
    resolved = resolve_profile(machine);
    if (!resolved) return resolved.error();
  }
  if (request.bed_given && job.bed_mm != machine.bed.size_mm) {
    return wrong("bed.size_mm", fmt::format("the bed of {} is {:g} x {:g} mm; leave it out or change the profile", machine.name,
                                            machine.bed.size_mm[0], machine.bed.size_mm[1]));
  }
  const PixelGrid grid = resolved->grid.image;
  return PowderPrinter{std::make_shared<const ResolvedMachine>(std::move(*resolved)), machine.bed.size_mm, grid};
}

Status resolve_machine(Job& job) {
  job.machine.resolved.reset();
  Result<PowderPrinter> printer = resolve_powder_printer(job);
  if (!printer) return printer.error();
  if (!printer->machine) return {};
  job.bed_mm = printer->bed_mm;
  job.machine.decides_bed = true;
  job.machine.resolved = std::move(printer->machine);
  return {};
}

}  // namespace lamina::pipeline
