#include "stages/program/binary_program.h"

#include <cmath>

namespace lamina::program {
namespace {

/// nm as i32, to which check_maintenance limits positions.
std::uint32_t nm_field(double mm) { return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::llround(mm * kNmPerMm))); }
std::uint32_t thousandths(double value) { return static_cast<std::uint32_t>(std::llround(value * 1000)); }

}  // namespace

void BinaryWriter::put(MaintenanceRecord kind, std::initializer_list<std::uint32_t> numbers, ProgramBytes& out) const {
  put_numbers(out, {ids_[static_cast<std::size_t>(kind)], static_cast<std::uint32_t>(numbers.size())});
  put_numbers(out, numbers);
}

void BinaryWriter::go(MachinePoint to, ProgramBytes& out) const {
  put(MaintenanceRecord::kGo, {nm_field(to[0]), nm_field(to[1])}, out);
}

void BinaryWriter::maintenance_of_layer(const LayerCycle& cycle, ProgramBytes& out) {
  const auto& powder = machine_.powder;
  const auto& cap = machine_.maintenance.cap_mm;
  if (cycle.refill) {
    if (cap) go(*cap, out);
    put(MaintenanceRecord::kFill, {}, out);
    if (cap) go(machine_.motion.safe_mm, out);
  }
  if (cycle.layer == 0 && powder.base_layers > 0) {
    put(MaintenanceRecord::kBase, {powder.base_layers, nm_field(powder.base_layer_mm)}, out);
  }
  if (powder.roller_rpm > 0) put(MaintenanceRecord::kRoller, {thousandths(powder.roller_rpm)}, out);
  serve(clock_.begin_layer(cycle.layer, machine_.motion.safe_mm), out);
}

void BinaryWriter::maintenance_before(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) {
  serve(clock_.before_sweep(carriage_.ends(sweep, vectors)), out);
}

void BinaryWriter::serve(MaintenanceClock::Due due, ProgramBytes& out) const {
  const auto& maintenance = machine_.maintenance;
  if (due.wipe) {
    const auto& [x, y, to_x, to_y] = *maintenance.wipe_mm;
    go({x, y}, out);
    put(MaintenanceRecord::kWipe, {nm_field(to_x), nm_field(to_y), thousandths(maintenance.wipe_speed_mm_s)}, out);
    put_own(maintenance.wipe_lines, out);
  }
  if (due.shot) {
    go(*maintenance.spit_mm, out);
    put(MaintenanceRecord::kShot, {maintenance.spit_drops}, out);
  }
}

void BinaryWriter::maintenance_after(ProgramBytes& out) {
  if (machine_.powder.dry_s == 0) return;
  go(machine_.maintenance.cap_mm.value_or(machine_.motion.safe_mm), out);
  put_own(machine_.powder.dry_on_lines, out);
  put(MaintenanceRecord::kDry, {thousandths(machine_.powder.dry_s)}, out);
  put_own(machine_.powder.dry_off_lines, out);
}

// Text in words of four bytes, the first one lowest, the last padded with zeros.
void BinaryWriter::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) {
    const auto words = static_cast<std::uint32_t>((line.size() + 3) / 4);
    put_numbers(out, {ids_[static_cast<std::size_t>(MaintenanceRecord::kOwn)], words});
    const auto bytes = std::as_bytes(std::span(line));
    out.insert(out.end(), bytes.begin(), bytes.end());
    out.insert(out.end(), words * 4 - line.size(), std::byte{0});
  }
}

}  // namespace lamina::program
