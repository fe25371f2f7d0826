#include "stages/program/care/care.h"

#include "stages/program/program_text.h"

namespace lamina::write {

void Care::go(std::string_view command, double x_mm, double y_mm, double speed_mm_s, ProgramBytes& out) const {
  put(out, "{} {}{} {}{} F{}\n", command, machine_.motion.x_axis, mm_text(x_mm), machine_.motion.y_axis, mm_text(y_mm),
      feed_text(speed_mm_s));
}

void Care::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) put(out, "{}\n", line);
}

void Care::refill(const LayerCycle& cycle, ProgramBytes& out) {
  if (!cycle.refill) return;
  const auto& motion = machine_.motion;
  const auto& cap = machine_.care.cap_mm;
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

void Care::begin_layer(const LayerCycle& cycle, ProgramBytes& out) {
  serve(clock_.begin_layer(cycle.layer, machine_.motion.safe_mm), out);
}

void Care::before_sweep(CareClock::Place from, CareClock::Place to, ProgramBytes& out) {
  serve(clock_.before_sweep(from, to), out);
}

void Care::before_sweep(CareClock::Place from, CareClock::Place to, double sweep_s, ProgramBytes& out) {
  serve(clock_.before_sweep(from, to, sweep_s), out);
}

void Care::serve(CareClock::Due due, ProgramBytes& out) const {
  const auto& care = machine_.care;
  const auto& motion = machine_.motion;
  if (due.wipe) {
    const auto& [x, y, to_x, to_y] = *care.wipe_mm;
    go(words_.travel, x, y, motion.travel_speed_mm_s, out);
    go("G1", to_x, to_y, care.wipe_speed_mm_s, out);
    if (!care.wipe_lines.empty()) put(out, "{}", words_.wait);
    put_own(care.wipe_lines, out);
  }
  if (due.shot) {
    go(words_.travel, (*care.spit_mm)[0], (*care.spit_mm)[1], motion.travel_speed_mm_s, out);
    put(out, "{}", words_.wait);
    words_.spit(machine_, out);
  } else if (due.wipe) {
    put(out, "{}", words_.wait);
  }
}

void Care::dry(ProgramBytes& out) const {
  if (machine_.powder.dry_s == 0) return;
  const auto at = machine_.care.cap_mm.value_or(machine_.motion.safe_mm);
  go(words_.travel, at[0], at[1], machine_.motion.travel_speed_mm_s, out);
  put(out, "{}", words_.wait);
  put_own(machine_.powder.dry_on_lines, out);
  put(out, "{}{}\n", words_.dwell,
      plain_text(machine_.powder.dry_s / words_.dwell_unit_s, words_.dwell_unit_s < 1 ? 0 : kPlainDigits));
  put_own(machine_.powder.dry_off_lines, out);
}

}  // namespace lamina::write
