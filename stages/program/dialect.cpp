#include "stages/program/dialect.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "stages/program/maintenance.h"
#include "stages/program/writers.h"

namespace lamina::program {
namespace {

constexpr std::array<Dialect, 7> kDialects = {{
    {"nuferbj", ".gcode", "G-code with vectors as hexadecimal words, powder cycle and counters; our own definition", 65'535, 0,
     true, kSaysAll, nuferbj::make_writer},
    {"raw", ".raw", "128-bit words as a Xaar XJ128 takes them, with swath heads; our own definition", 65'535, 120, false,
     kSaysAll | kSaysDrops, raw::make_writer},
    {"planes", ".planes", "32-bit padded planes of a swath, as production heads take them; our own definition", 65'535, 31,
     false, kSaysAll | kSaysDrops, planes::make_writer},
    {"hp45", ".hp45", "HP45 controller V4, firmware 0.08: SBR lines for it, G-code for a separate motion controller", 300, 0,
     true, kSaysBase | kSaysMaintenance | kSaysSeconds | kSaysCap, hp45::make_writer, hp45::check},
    {"oasis", ".oasis", "Oasis: an HP45 controller V4 and GRBL, with the new layer of the Oasis controller", 300, 0, true,
     kSaysAll, oasis::make_writer, oasis::check},
    {"brundlefab", ".gcode", "G-code of the BrundleFab, whose Y loads an ink bar of 840 dots: T1 P, 12 nozzles", 12, 0, true,
     kSaysBase | kSaysShots | kSaysSeconds, brundlefab::make_writer, brundlefab::check,
     MaintenanceRules{.own_positions = true}},
    {"m578", ".gcode", "M578 S of RepRapFirmware 1.09r to 3.4 built with inkjet support: one head, 12 nozzles, a stop a pixel",
     12, 0, true, kSaysAll & ~std::uint32_t{kSaysRoller}, m578::make_writer, m578::check,
     MaintenanceRules{.shot_s = m578::shot_s, .longest_sweep_s = m578::longest_sweep_s}},
}};

}  // namespace

std::span<const Dialect> dialects() { return kDialects; }

const Dialect* find_dialect(std::string_view id) {
  const auto found = std::ranges::find(kDialects, id, &Dialect::id);
  return found == kDialects.end() ? nullptr : &*found;
}

Status check_dialect(const Dialect& dialect, const Machine& machine, const HeadGrid& grid) {
  if (machine.head.max_drops > 1 && (dialect.says & kSaysDrops) == 0) {
    return Error{Fault::kUsage,
                 fmt::format("{}: head.max_drops: {}, and a command of {} fires one drop of a nozzle; give 1, and "
                             "each drop of a pixel is a sweep",
                             machine.name, machine.head.max_drops, dialect.id)};
  }
  if (grid.nozzles > dialect.max_nozzles) {
    return Error{Fault::kUsage, fmt::format("{}: machine.dialect: {} supports at most {} nozzles, the head has {}",
                                            machine.name, dialect.id, dialect.max_nozzles, grid.nozzles)};
  }
  if (Status status = check_maintenance(dialect, machine, grid); !status) return status;
  return dialect.check != nullptr ? dialect.check(machine, grid) : Status();
}

}  // namespace lamina::program
