#include "stages/program/maintenance/maintenance.h"

#include <cmath>

#include "stages/program/program_text.h"

namespace lamina::program {

double move_seconds(const Machine& machine, double way_mm, double speed_mm_s) {
  if (speed_mm_s * 60 >= 1) speed_mm_s = std::round(speed_mm_s * 60) / 60;  // as it is spelt
  const double a = machine.motion.acceleration_mm_s2;
  if (a == 0) return way_mm / speed_mm_s;
  return way_mm < speed_mm_s * speed_mm_s / a ? 2 * std::sqrt(way_mm / a) : way_mm / speed_mm_s + speed_mm_s / a;
}

double shot_seconds(const Machine& machine) { return machine.maintenance.spit_drops / machine.head.highest_frequency_hz; }

double MaintenanceClock::seconds(MachinePoint from, MachinePoint to, double speed_mm_s) const {
  return move_seconds(machine_, std::hypot(to[0] - from[0], to[1] - from[1]), speed_mm_s);
}

MaintenanceClock::Due MaintenanceClock::begin_layer(std::uint32_t layer, MachinePoint at) {
  const auto& maintenance = machine_.maintenance;
  const auto due = [&](std::uint32_t layers, double limit_s) { return limit_s > 0 || (layers > 0 && layer % layers == 0); };
  at_ = at;
  return serve(due(maintenance.wipe_layers, maintenance.wipe_seconds), due(maintenance.spit_layers, maintenance.spit_seconds));
}

MaintenanceClock::Due MaintenanceClock::before_sweep(MachinePoint from, MachinePoint to) {
  return before_sweep(from, to, seconds(from, to, machine_.motion.scan_speed_mm_s));
}

MaintenanceClock::Due MaintenanceClock::before_sweep(MachinePoint from, MachinePoint to, double sweep_s) {
  const auto& maintenance = machine_.maintenance;
  const double travel = machine_.motion.travel_speed_mm_s;
  double now = seconds(at_, from, travel) + sweep_s;
  const bool shot = maintenance.spit_seconds > 0 && since_shot_ + now > kShareOfLimit * maintenance.spit_seconds;
  if (shot) {  // the wiper waits for the shot as well
    now = seconds(at_, *maintenance.spit_mm, travel) + shot_s_ + seconds(*maintenance.spit_mm, from, travel) + sweep_s;
  }
  const bool wipe = maintenance.wipe_seconds > 0 && since_wipe_ + now > kShareOfLimit * maintenance.wipe_seconds;
  const Due due = serve(wipe, shot);
  const double taken = seconds(at_, from, travel) + sweep_s;
  since_wipe_ += taken;
  since_shot_ += taken;
  at_ = to;
  return due;
}

MaintenanceClock::Due MaintenanceClock::serve(bool wipe, bool shot) {
  const auto& maintenance = machine_.maintenance;
  shot = shot || (wipe && maintenance.spits());
  if (wipe) {
    at_ = {(*maintenance.wipe_mm)[2], (*maintenance.wipe_mm)[3]};
    since_wipe_ = 0;
  }
  if (shot) {
    since_wipe_ += seconds(at_, *maintenance.spit_mm, machine_.motion.travel_speed_mm_s) + shot_s_;
    at_ = *maintenance.spit_mm;
    since_shot_ = 0;
  }
  return {wipe, shot};
}

void MaintenanceWriter::go(std::string_view command, double x_mm, double y_mm, double speed_mm_s, ProgramBytes& out) const {
  put(out, "{} {}{} {}{} F{}\n", command, machine_.motion.x_axis, mm_text(x_mm), machine_.motion.y_axis, mm_text(y_mm),
      feed_text(speed_mm_s));
}

void MaintenanceWriter::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) put(out, "{}\n", line);
}

void MaintenanceWriter::refill(const LayerCycle& cycle, ProgramBytes& out) {
  if (!cycle.refill) return;
  const auto& motion = machine_.motion;
  const auto& cap = machine_.maintenance.cap_mm;
  if (cap) {
    go(words_.travel, (*cap)[0], (*cap)[1], motion.travel_speed_mm_s, out);
    put(out, "{}", words_.wait);
  }
  put(out, "{}", words_.refill);
  if (cap) {
    go(words_.travel, motion.safe_mm[0], motion.safe_mm[1], motion.travel_speed_mm_s, out);
    put(out, "{}", words_.wait);
  }
}

void MaintenanceWriter::begin_layer(const LayerCycle& cycle, ProgramBytes& out) {
  serve(clock_.begin_layer(cycle.layer, machine_.motion.safe_mm), out);
}

void MaintenanceWriter::before_sweep(MaintenanceClock::MachinePoint from, MaintenanceClock::MachinePoint to,
                                     ProgramBytes& out) {
  serve(clock_.before_sweep(from, to), out);
}

void MaintenanceWriter::before_sweep(MaintenanceClock::MachinePoint from, MaintenanceClock::MachinePoint to, double sweep_s,
                                     ProgramBytes& out) {
  serve(clock_.before_sweep(from, to, sweep_s), out);
}

void MaintenanceWriter::serve(MaintenanceClock::Due due, ProgramBytes& out) const {
  const auto& maintenance = machine_.maintenance;
  const auto& motion = machine_.motion;
  if (due.wipe) {
    const auto& [x, y, to_x, to_y] = *maintenance.wipe_mm;
    go(words_.travel, x, y, motion.travel_speed_mm_s, out);
    go("G1", to_x, to_y, maintenance.wipe_speed_mm_s, out);
    if (!maintenance.wipe_lines.empty()) put(out, "{}", words_.wait);
    put_own(maintenance.wipe_lines, out);
  }
  if (due.shot) {
    go(words_.travel, (*maintenance.spit_mm)[0], (*maintenance.spit_mm)[1], motion.travel_speed_mm_s, out);
    put(out, "{}", words_.wait);
    words_.spit(machine_, out);
  } else if (due.wipe) {
    put(out, "{}", words_.wait);
  }
}

void MaintenanceWriter::dry(ProgramBytes& out) const {
  if (machine_.powder.dry_s == 0) return;
  const auto at = machine_.maintenance.cap_mm.value_or(machine_.motion.safe_mm);
  go(words_.travel, at[0], at[1], machine_.motion.travel_speed_mm_s, out);
  put(out, "{}", words_.wait);
  put_own(machine_.powder.dry_on_lines, out);
  put(out, "{}{}\n", words_.dwell,
      plain_text(machine_.powder.dry_s / words_.dwell_unit_s, words_.dwell_unit_s < 1 ? 0 : kPlainDigits));
  put_own(machine_.powder.dry_off_lines, out);
}

namespace {

/// nm as i32, in which check_maintenance holds places.
std::uint32_t nm_field(double mm) { return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::llround(mm * kNmPerMm))); }
std::uint32_t thousandths(double value) { return static_cast<std::uint32_t>(std::llround(value * 1000)); }

}  // namespace

void MaintenanceRecords::go(MaintenanceClock::MachinePoint to, ProgramBytes& out) const {
  put(MaintenanceRecord::kGo, {nm_field(to[0]), nm_field(to[1])}, out);
}

void MaintenanceRecords::begin_layer(const LayerCycle& cycle, ProgramBytes& out) {
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

void MaintenanceRecords::before_sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) {
  serve(clock_.before_sweep(carriage_.position(carriage_.begin(sweep, vectors), sweep.first_line),
                            carriage_.position(carriage_.end(sweep, vectors), sweep.first_line)),
        out);
}

void MaintenanceRecords::serve(MaintenanceClock::Due due, ProgramBytes& out) const {
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

void MaintenanceRecords::dry(ProgramBytes& out) const {
  if (machine_.powder.dry_s == 0) return;
  go(machine_.maintenance.cap_mm.value_or(machine_.motion.safe_mm), out);
  put_own(machine_.powder.dry_on_lines, out);
  put(MaintenanceRecord::kDry, {thousandths(machine_.powder.dry_s)}, out);
  put_own(machine_.powder.dry_off_lines, out);
}

// Text in words of four bytes, the first one lowest, the last padded with zeros.
void MaintenanceRecords::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) {
    std::vector<std::uint32_t> words((line.size() + 3) / 4, 0);
    for (std::size_t i = 0; i < line.size(); ++i) {
      words[i / 4] |= std::uint32_t{static_cast<unsigned char>(line[i])} << (i % 4 * 8);
    }
    put_(MaintenanceRecord::kOwn, words, out);
  }
}

}  // namespace lamina::program
