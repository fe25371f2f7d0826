// Care of head and powder on the virtual machine, whatever the dialect: stages/replay/printing.h.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/replay/printing.h"

namespace lamina::replay {

void Printing::leaves_wiper(std::string_view what) {
  if (own_ > 0) fault(fmt::format("{} before all lines of the machine's own stand there", what));
  own_ = 0;
  at_wiper_ = false;
}

// A wipe is a G1 as fast as the profile has it: travels may have the same ends.
void Printing::head_stands_at(double x_mm, double y_mm, double works_mm_s) {
  const auto& care = profile().care;
  leaves_wiper("the head goes on");
  leaves_place();
  if (lamp_on_) {
    fault(fmt::format("the head moves before '{}', which ends the pause to dry", profile().powder.dry_off_lines.front()));
  }
  if (filled_ && std::hypot(x_mm - profile().motion.safe_mm[0], y_mm - profile().motion.safe_mm[1]) > 1e-3) {
    fault(fmt::format("the head goes to {:g}, {:g} mm behind the pause to fill vats, not to its safe place", x_mm, y_mm));
  }
  filled_ = false;
  const bool slow = std::abs(works_mm_s - care.wipe_speed_mm_s) < 1.01 * kHalfMmPerMinute;
  if (const auto& wiper = care.wipe_mm; wiper && slow) {
    const auto [x, y] = head_mm_.value_or(profile().motion.safe_mm);
    if (std::hypot(x - (*wiper)[0], y - (*wiper)[1]) + std::hypot(x_mm - (*wiper)[2], y_mm - (*wiper)[3]) < 1e-3) {
      at_wiper_ = true;
      wiped_s_ = seconds_;
      ++count.wipes;
    }
  }
  head_mm_ = {x_mm, y_mm};
}

void Printing::leaves_place() {
  const std::uint32_t drops = profile().care.spit_drops;
  if (spat_here_ % std::max(1u, drops) != 0) {
    fault(fmt::format("nozzles fire {} drops off the bed, where {} are a shot", spat_here_, drops));
  }
  spat_here_ = 0;
}

void Printing::check_care(std::string_view what, std::uint32_t every, double limit_s, double done_s) {
  const bool due = limit_s > 0 || (every > 0 && layer_.index % every == 0);
  if (done_s < 0 && due) return fault(fmt::format("scans before the head is {}, as it has to be in this layer", what));
  if (limit_s == 0 || seconds_ - done_s <= limit_s) return;
  fault(fmt::format("a sweep ends {:.2f} s after the head was {} where {:g} may pass", seconds_ - done_s, what, limit_s));
}

void Printing::beside_bed(double x_mm, double y_mm) {
  const auto& mount = profile().mounting;
  const bool x = mount.scan_axis == ScanAxis::kX;
  double um = ((x ? y_mm : x_mm) - mount.offset_mm[x ? 1 : 0]) * 1000;
  if (mount.nozzle_0 == Side::kBack || mount.nozzle_0 == Side::kRight) um = machine_.lines_ * machine_.line_um_ - um;
  const auto line = static_cast<std::int64_t>(std::floor(um / machine_.line_um_));
  const double step = ((x ? x_mm : y_mm) - position_of(0)) / (position_of(1) - position_of(0));
  for (std::uint32_t nozzle = 0; nozzle < nozzles(); ++nozzle) {
    const auto [column, row] = machine_.nozzle_at(line, step, nozzle);
    if (machine_.nozzle_[nozzle].blocked || column < -0.5 || row < -0.5 || column > machine_.columns_ - 0.5 ||
        row > machine_.rows_ - 0.5) {
      continue;
    }
    return fault(fmt::format("nozzle {} fires off the bed where column {:.0f}, row {:.0f} of it is", nozzle, column, row));
  }
}

void Printing::spits(double x_mm, double y_mm, std::uint64_t drops, double seconds) {
  const auto& care = profile().care;
  if (!care.spits() || !care.spit_mm) return fault("fires off the bed, and the profile has no place for it");
  if (std::hypot(x_mm - (*care.spit_mm)[0], y_mm - (*care.spit_mm)[1]) > 1e-3) {
    return fault(fmt::format("fires off the bed at {:g}, {:g} mm, not at {:g}, {:g}", x_mm, y_mm, (*care.spit_mm)[0],
                             (*care.spit_mm)[1]));
  }
  beside_bed(x_mm, y_mm);
  for (const VirtualMachine::Nozzle& nozzle : machine_.nozzle_) count.spat += nozzle.blocked ? 0 : drops;
  leaves_wiper("nozzles fire off the bed");
  takes(seconds);
  spat_here_ += drops;
  if (spat_here_ > care.spit_drops) {
    return fault(fmt::format("nozzles fire {} drops off the bed, where {} are a shot", spat_here_, care.spit_drops));
  }
  if (spat_here_ < care.spit_drops) return;
  spat_s_ = seconds_;
  ++count.spits;
}

// Where the profile has the head wait in pauses.
bool Printing::capped() const {
  const auto at = profile().care.cap_mm.value_or(profile().motion.safe_mm);
  const auto [x, y] = head_mm_.value_or(profile().motion.safe_mm);
  return std::hypot(x - at[0], y - at[1]) < 1e-3;
}

void Printing::waits_capped(std::string_view what) {
  const auto& cap = profile().care.cap_mm;
  const auto at = cap.value_or(profile().motion.safe_mm);
  if (capped()) return;
  fault(fmt::format("{} while the head is not at its {}, {:g}, {:g} mm", what, cap ? "cap" : "safe place", at[0], at[1]));
}

void Printing::refills() {
  if (count.fed_mm[0] + count.fed_mm[1] > 0) return fault("waits for the vats to be filled behind the layer's powder");
  waits_capped("the vats are filled");
  filled_ = profile().care.cap_mm.has_value();
  if (++count.refills > 1) fault("waits for the vats to be filled a second time");
}

void Printing::dwells(double seconds) {
  waits_capped("the layer dries");
  leaves_wiper("the layer dries");
  dwelt_s_ += seconds;
  takes(seconds);
}

bool Printing::takes_own(std::string_view line) {
  const auto& powder = profile().powder;
  // The block that may come now.
  const auto& lines = at_wiper_ ? profile().care.wipe_lines : dwelt_s_ > 0 ? powder.dry_off_lines : powder.dry_on_lines;
  if (own_ < lines.size() && lines[own_] == line) {
    if (under_way_) fault(fmt::format("'{}' comes while the head may still move; G4 P0 waits for it", line));
    if (!at_wiper_) waits_capped(fmt::format("'{}' of the pause to dry comes", line));
    if (++own_ < lines.size()) return true;
    own_ = 0;
    ++(at_wiper_ ? wiper_blocks_ : lamp_blocks_);
    lamp_on_ = !at_wiper_ && dwelt_s_ == 0 && !profile().powder.dry_off_lines.empty();
    at_wiper_ = false;
    return true;
  }
  if (own_ > 0) fault(fmt::format("'{}' stands where the machine's own '{}' has to", line, lines[own_]));
  return false;
}

void Printing::roller_turns(double rpm) { rpm_ = rpm; }

void Printing::tells_host(std::string_view record, bool of_powder) {
  if (of_powder && host_spread_) return fault(fmt::format("{} stands behind the layer's powder", record));
  if (of_powder && record != "FILL" && !head_at_safe()) {
    return fault(fmt::format("{} stands where the head is not at its safe place, and the powder is spread", record));
  }
  host_spread_ = host_spread_ || !of_powder;
}

void Printing::tells_base(std::uint32_t layers, double layer_mm) {
  if (based_) return fault("tells a base of powder a second time");
  based_ = true;
  if (layers == base_layers() && std::abs(layer_mm - profile().powder.base_layer_mm) < 1e-6) return;
  fault(fmt::format("tells a base of {} layers of {:g} mm, where {} of {:g} have to be", layers, layer_mm, base_layers(),
                    profile().powder.base_layer_mm));
}

void Printing::check_pauses() {
  const auto& powder = profile().powder;
  if (std::abs(dwelt_s_ - powder.dry_s) > 1e-3) {
    wrong_cycle(fmt::format("the layer dries for {:g} s where {:g} have to be", dwelt_s_, powder.dry_s));
  }
  const std::uint32_t lamps = (powder.dry_on_lines.empty() ? 0 : 1) + (powder.dry_off_lines.empty() ? 0 : 1);
  const std::uint32_t wipers = profile().care.wipe_lines.empty() ? 0 : count.wipes;
  if (lamp_blocks_ == lamps && wiper_blocks_ == wipers) return;
  wrong_cycle(
      fmt::format("the machine's own lines stand {} times where {} have to", lamp_blocks_ + wiper_blocks_, lamps + wipers));
}

// Of a program that moves no powder.
void Printing::check_told() {
  check_pauses();
  if (base_layers() > 0 && !based_) wrong_cycle(fmt::format("its base of {} layers is not told", base_layers()));
  if (const double rpm = profile().powder.roller_rpm; std::abs(rpm_ - rpm) > 1e-3) {
    wrong_cycle(fmt::format("the roller is told to make {:g} turns a minute where {:g} have to be", rpm_, rpm));
  }
}

}  // namespace lamina::replay
