#include "pipeline/machine/powder_printer.h"

#include <fmt/format.h>

#include "pipeline/job/lists/named_files.h"
#include "pipeline/machine/profiles.h"
#include "stages/program/dialect.h"
#include "stages/program/head_grid.h"

namespace lamina::pipeline {
namespace {

Error wrong(const std::string& key, const std::string& what) { return {Fault::kUsage, fmt::format("{}: {}", key, what)}; }

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
  PowderPrinter printer;
  if (request.profile.empty()) {
    if (request.scan_speed_mm_s || request.blocked || request.vat_rule || !request.presets.empty())
      return wrong("machine.profile", "is missing; name one with --machine");
    printer.bed = bare_bed(job);
    const auto dpi = job.dpi.value_or(kBareDpi);
    printer.grid = {PixelAxis(dpi[0], nm_of(printer.bed.size_mm[0])), PixelAxis(dpi[1], nm_of(printer.bed.size_mm[1]))};
    return printer;
  }
  const Status there = read::check_there(job.missing, request.profile, request.presets);
  if (!there) return there.error();
  Result<Machine> found = find_machine(request.profile, request.presets);
  if (!found) return found.error();
  Machine& machine = *found;
  if (request.scan_speed_mm_s) machine.motion.scan_speed_mm_s = *request.scan_speed_mm_s;
  if (request.vat_rule) machine.powder.vat_rule = *request.vat_rule;
  if (request.blocked) machine.head.blocked = *request.blocked;
  auto resolved = resolve_profile(machine);
  if (!resolved) return resolved.error();
  if (job.dpi) {
    if (Status status = program::ask_for_dpi(machine, resolved->grid, *job.dpi); !status) return status.error();
    resolved = resolve_profile(machine);
    if (!resolved) return resolved.error();
  }
  printer.bed = {machine.bed.size_mm, true};
  if (job.bed_mm && *job.bed_mm != machine.bed.size_mm) {
    return wrong("bed.size_mm", fmt::format("the bed of {} is {:g} x {:g} mm; leave it out or change the profile", machine.name,
                                            machine.bed.size_mm[0], machine.bed.size_mm[1]));
  }
  printer.grid = resolved->grid.image;
  printer.machine = std::move(*resolved);
  return printer;
}

}  // namespace lamina::pipeline
