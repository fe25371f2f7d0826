#include "stages/program/maintenance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina::program {
namespace {

// What dialects add to a sweep at either end, in addition to its ramps: the HP45 controller's rows and measures of speed.
constexpr double kRunUpMm = 20;

// The least of kPlainDigits.
constexpr double kMinPlain = 1e-3;

/// Commands that programs have, or that end them: they must not be inserted.
constexpr std::string_view kOfPrograms[] = {"M0",   "M1",   "M2",   "M3",   "M4",   "M5",   "M25",  "M30",  "M112", "M226",
                                            "M400", "M578", "M999", "M810", "M811", "M812", "M813", "M814", "M815", "M816"};

double way(MachinePoint from, MachinePoint to) { return std::hypot(to[0] - from[0], to[1] - from[1]); }

/// The box of the bed that the nozzles are over with the carriage at a place, mm.
struct Under {
  MachinePoint low, high;
  void add(const Under& other) {
    for (std::size_t i = 0; i < 2; ++i) low[i] = std::min(low[i], other.low[i]), high[i] = std::max(high[i], other.high[i]);
  }
};

Under under_head(const Machine& machine, const HeadGrid& grid, MachinePoint carriage) {
  const std::size_t along = grid.scan_axis == ScanAxis::kX ? 0 : 1, across = 1 - along;
  Under box{};
  for (std::size_t i = 0; i < 2; ++i) box.low[i] = box.high[i] = carriage[i] - machine.mounting.offset_mm[i];
  const double row = (grid.nozzles - 1.0) * grid.passes * (grid.line_position_nm(1) - grid.line_position_nm(0)) / kNmPerMm;
  const double lag = -static_cast<double>(grid.max_lag) * (grid.step_position_nm(1) - grid.step_position_nm(0)) / kNmPerMm;
  box.low[across] += std::min(row, 0.0), box.high[across] += std::max(row, 0.0);
  box.low[along] += std::min(lag, 0.0), box.high[along] += std::max(lag, 0.0);
  return box;
}

bool over_bed(const Machine& machine, const HeadGrid& grid, const Under& box) {
  const double margin = std::max(grid.line_nm, grid.position_nm) / kNmPerMm;
  for (std::size_t i = 0; i < 2; ++i) {
    if (box.high[i] < -margin || box.low[i] > machine.bed.size_mm[i] + margin) return false;
  }
  return true;
}

/// One profile against one dialect.
class Checker {
 public:
  Checker(const Dialect& dialect, const Machine& machine, const HeadGrid& grid)
      : dialect_(dialect), machine_(machine), maintenance_(machine.maintenance), grid_(grid) {}

  Status check() {
    if (Status status = check_words(); !status) return status;
    if (dialect_.maintenance.own_positions) return {};
    if (Status status = check_positions(); !status) return status;
    if (Status status = check_wiper_alone(); !status) return status;
    if (Status status = check_clock("maintenance.spit_seconds", maintenance_.spit_seconds, maintenance_.spit_mm, 0); !status)
      return status;
    if (!maintenance_.wipes()) return {};
    const MachinePoint wiped{(*maintenance_.wipe_mm)[2], (*maintenance_.wipe_mm)[3]};
    if (!maintenance_.spits()) return check_clock("maintenance.wipe_seconds", maintenance_.wipe_seconds, wiped, 0);
    const double shot = move_seconds(machine_, way(wiped, *maintenance_.spit_mm), machine_.motion.travel_speed_mm_s) + shot_s();
    return check_clock("maintenance.wipe_seconds", maintenance_.wipe_seconds, maintenance_.spit_mm, shot);
  }

 private:
  Error wrong(std::string_view key, std::string_view what) const { return wrong_key(machine_, key, what); }

  Status check_words() const {
    const auto& powder = machine_.powder;
    const bool depths = std::ranges::any_of(powder.vat_depth_mm, [](double mm) { return mm > 0; });
    const struct {
      std::string_view key;
      bool requested;
      std::uint32_t says;
    } rows[] = {{"powder.base_layers", powder.base_layers > 0, kSaysBase},
                {"powder.refill", powder.refill == VatRefill::kPause, kSaysRefill},
                {"powder.dry_s", powder.dry_s > 0, kSaysDry},
                {"powder.roller_rpm", powder.roller_rpm > 0, kSaysRoller},
                {maintenance_.spit_layers > 0 ? "maintenance.spit_layers" : "maintenance.spit_seconds", maintenance_.spits(),
                 kSaysShots},
                {maintenance_.wipe_layers > 0 ? "maintenance.wipe_layers" : "maintenance.wipe_seconds", maintenance_.wipes(),
                 kSaysWipes},
                {"powder.dry_on_lines", !powder.dry_on_lines.empty(), kSaysOwn},
                {"powder.dry_off_lines", !powder.dry_off_lines.empty(), kSaysOwn},
                {"maintenance.wipe_lines", !maintenance_.wipe_lines.empty(), kSaysOwn},
                {"maintenance.cap_mm", maintenance_.cap_mm.has_value(), kSaysCap},
                {"maintenance.spit_seconds", maintenance_.spit_seconds > 0, kSaysSeconds},
                {"maintenance.wipe_seconds", maintenance_.wipe_seconds > 0, kSaysSeconds}};
    for (const auto& [key, requested, says] : rows) {
      if (!requested || (dialect_.says & says) == says) continue;
      return wrong(key, fmt::format("programs of the dialect {} cannot say it (docs/reference/print_program.md has why); leave "
                                    "it to the host, with its time in powder.pause_s and its drops in cost.spit_drops",
                                    dialect_.id));
    }
    for (const auto& [key, value] :
         {std::pair("powder.dry_s", powder.dry_s), std::pair("powder.roller_rpm", powder.roller_rpm)}) {
      if (value > 0 && value < kMinPlain) return wrong(key, fmt::format("{:g} is written as 0; give at least 0.001", value));
    }
    if (Status status = check_own("powder.dry_on_lines", powder.dry_on_lines, powder.dry_s > 0); !status) return status;
    if (Status status = check_own("powder.dry_off_lines", powder.dry_off_lines, powder.dry_s > 0); !status) return status;
    if (Status status = check_own("maintenance.wipe_lines", maintenance_.wipe_lines, true); !status) return status;
    if (powder.refill == VatRefill::kPause && !depths) return wrong("powder.refill", "pauses need powder.vat_depth_mm");
    if (maintenance_.spits() && !maintenance_.spit_mm)
      return wrong("maintenance.spit_mm", "is missing; give the carriage's position outside of the bed");
    if (maintenance_.wipes() && !maintenance_.wipe_mm)
      return wrong("maintenance.wipe_mm", "is missing; give x, y of both ends of the wiper");
    return {};
  }

  /// Lines of the machine's own. paused  whether the program comes to where they stand
  Status check_own(std::string_view key, const std::vector<std::string>& lines, bool paused) const {
    for (const std::string& line : lines) {
      const std::string command = line.substr(0, line.find(' '));
      const std::string_view number = std::string_view(command).substr(1);
      if (number.find_first_not_of("0123456789") != std::string_view::npos || (number.size() > 1 && number[0] == '0')) {
        return wrong(key, fmt::format("{}: give the command's number whole and without leading zeros", command));
      }
      if (std::ranges::find(kOfPrograms, command) == std::end(kOfPrograms)) continue;
      return wrong(key, fmt::format("{} is a command of programs; give the machine's own alone", command));
    }
    if (!lines.empty() && !paused) return wrong(key, "there is no pause to dry; give powder.dry_s");
    return {};
  }

  /// A wiper that is where the head travels, and as fast: a wipe cannot be distinguished from a travel.
  Status check_wiper_alone() const {
    const auto& motion = machine_.motion;
    if (!maintenance_.wipes() || feed_text(maintenance_.wipe_speed_mm_s) != feed_text(motion.travel_speed_mm_s)) return {};
    const auto& [x, y, to_x, to_y] = *maintenance_.wipe_mm;
    const std::optional<MachinePoint> positions[] = {motion.safe_mm, maintenance_.spit_mm, maintenance_.cap_mm};
    for (const auto& from : positions) {
      for (const auto& to : positions) {
        if (!from || !to || way({x, y}, *from) + way({to_x, to_y}, *to) >= 1e-3) continue;
        return wrong("maintenance.wipe_mm",
                     "the head travels there as fast anyway; give another wiper, or maintenance.wipe_speed_mm_s");
      }
    }
    return {};
  }

  /// Records of places are whole nm of 32 bits.
  Status check_reach() const {
    constexpr double kMaxMm = 2147;
    const auto beyond = [](const auto& position) {
      return position && std::ranges::any_of(*position, [](double mm) { return std::abs(mm) > kMaxMm; });
    };
    for (const auto& [key, is] : {std::pair("maintenance.spit_mm", beyond(maintenance_.spit_mm)),
                                  {"maintenance.wipe_mm", beyond(maintenance_.wipe_mm)},
                                  {"maintenance.cap_mm", beyond(maintenance_.cap_mm)}}) {
      if (is && !dialect_.has_motion) return wrong(key, fmt::format("{} has positions up to {:g} mm", dialect_.id, kMaxMm));
    }
    return {};
  }

  Status check_positions() const {
    if (Status status = check_reach(); !status) return status;
    const auto check = [&](std::string_view key, const Under& box) -> Status {
      if (!over_bed(machine_, grid_, box)) return {};
      return wrong(key, fmt::format("nozzles are over the bed there, x {:.2f} to {:.2f} and y {:.2f} to {:.2f} mm of it; give "
                                    "a carriage position outside of it",
                                    box.low[0], box.high[0], box.low[1], box.high[1]));
    };
    for (const auto& [key, at] :
         {std::pair("maintenance.spit_mm", maintenance_.spit_mm), {"maintenance.cap_mm", maintenance_.cap_mm}}) {
      if (Status status = at ? check(key, under_head(machine_, grid_, *at)) : Status(); !status) return status;
    }
    if (!maintenance_.wipe_mm) return {};
    const auto& [x, y, to_x, to_y] = *maintenance_.wipe_mm;
    Under box = under_head(machine_, grid_, {x, y});
    box.add(under_head(machine_, grid_, {to_x, to_y}));
    if (way({x, y}, {to_x, to_y}) < 1e-3) return wrong("maintenance.wipe_mm", "the head does not move there; give another end");
    return check("maintenance.wipe_mm", box);
  }

  /// Whether the longest sweep ends in time. from  where the head goes to it after so many seconds
  Status check_clock(std::string_view key, double limit_s, const std::optional<MachinePoint>& from, double after_s) const {
    if (limit_s == 0) return {};
    const auto& motion = machine_.motion;
    const auto& [width, depth] = machine_.bed.size_mm;
    const double clearance = motion.ramp_mm + kRunUpMm + static_cast<double>(grid_.max_lag) * grid_.step_nm() / kNmPerMm +
                             grid_.swath_lines() * grid_.line_nm / kNmPerMm;
    double farthest = 0;
    for (const double x : {-clearance, width + clearance}) {
      for (const double y : {-clearance, depth + clearance}) {
        farthest = std::max(farthest, way(*from, {x + machine_.mounting.offset_mm[0], y + machine_.mounting.offset_mm[1]}));
      }
    }
    const double sweep_s =
        dialect_.maintenance.longest_sweep_s != nullptr
            ? dialect_.maintenance.longest_sweep_s(machine_, grid_)
            : move_seconds(machine_,
                           static_cast<double>(grid_.steps()) * grid_.step_nm() / kNmPerMm + 2 * (motion.ramp_mm + kRunUpMm),
                           motion.scan_speed_mm_s);
    const double needed = after_s + move_seconds(machine_, farthest, motion.travel_speed_mm_s) + sweep_s;
    if (needed < kShareOfLimit * limit_s) return {};
    return wrong(key, fmt::format("{:g} s, and a sweep ends up to {:.2f} s later; give more, or move faster", limit_s, needed));
  }

  double shot_s() const {
    return dialect_.maintenance.shot_s != nullptr ? dialect_.maintenance.shot_s(machine_) : shot_seconds(machine_);
  }

  const Dialect& dialect_;
  const Machine& machine_;
  const Machine::Maintenance& maintenance_;
  const HeadGrid& grid_;
};

}  // namespace

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

MaintenanceClock::Due MaintenanceClock::before_sweep(const std::array<MachinePoint, 2>& ends, std::optional<double> takes_s) {
  const auto& [from, to] = ends;
  const auto& maintenance = machine_.maintenance;
  const double sweep_s = takes_s ? *takes_s : seconds(from, to, machine_.motion.scan_speed_mm_s);
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

/// Beyond the bed, and waits there if the dialect has to.
void MaintenanceWriter::travel(MachinePoint to, ProgramBytes& out) const {
  put_move(machine_, words_.travel, to, machine_.motion.travel_speed_mm_s, out);
  put(out, "{}", words_.wait);
}

void MaintenanceWriter::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) put(out, "{}\n", line);
}

void MaintenanceWriter::refill(const LayerCycle& cycle, ProgramBytes& out) {
  if (!cycle.refill) return;
  const auto& cap = machine_.maintenance.cap_mm;
  if (cap) travel(*cap, out);
  put(out, "{}", words_.refill);
  if (cap) travel(machine_.motion.safe_mm, out);
}

void MaintenanceWriter::serve(MaintenanceClock::Due due, ProgramBytes& out) const {
  const auto& maintenance = machine_.maintenance;
  if (due.wipe) {
    const auto& [x, y, to_x, to_y] = *maintenance.wipe_mm;
    put_move(machine_, words_.travel, {x, y}, machine_.motion.travel_speed_mm_s, out);
    put_move(machine_, "G1", {to_x, to_y}, maintenance.wipe_speed_mm_s, out);
    if (!maintenance.wipe_lines.empty()) put(out, "{}", words_.wait);
    put_own(maintenance.wipe_lines, out);
  }
  if (due.shot) {
    travel(*maintenance.spit_mm, out);
    words_.spit(machine_, out);
  } else if (due.wipe) {
    put(out, "{}", words_.wait);
  }
}

void MaintenanceWriter::dry(ProgramBytes& out) const {
  if (machine_.powder.dry_s == 0) return;
  travel(machine_.maintenance.cap_mm.value_or(machine_.motion.safe_mm), out);
  put_own(machine_.powder.dry_on_lines, out);
  put(out, "{}{}\n", words_.dwell,
      plain_text(machine_.powder.dry_s / words_.dwell_unit_s, words_.dwell_unit_s < 1 ? 0 : kPlainDigits));
  put_own(machine_.powder.dry_off_lines, out);
}

Status check_maintenance(const Dialect& dialect, const Machine& machine, const HeadGrid& grid) {
  return Checker(dialect, machine, grid).check();
}

void warn_of_idle_maintenance(const Machine& machine, std::vector<Warning>& warnings) {
  const auto& maintenance = machine.maintenance;
  const auto& powder = machine.powder;
  const bool pauses = powder.dry_s > 0 || powder.refill == VatRefill::kPause;
  const bool shot = maintenance.spit_mm || maintenance.spit_drops != Machine::Maintenance().spit_drops;
  std::string idle;
  const auto add = [&](bool said, bool requested, const std::string& what) {
    if (said && !requested) idle += fmt::format("{}{}", idle.empty() ? "" : "; ", what);
  };
  add(shot, maintenance.spits(), "no shot: maintenance.spit_layers and maintenance.spit_seconds are 0");
  add(maintenance.wipe_mm || !maintenance.wipe_lines.empty(), maintenance.wipes(),
      "no wipe: maintenance.wipe_layers and maintenance.wipe_seconds are 0");
  add(maintenance.cap_mm.has_value(), pauses,
      "no pause under maintenance.cap_mm: powder.dry_s is 0 and powder.refill no \"pause\"");
  add(!powder.dry_on_lines.empty(), !powder.dry_off_lines.empty(),
      "what powder.dry_on_lines switch on stays on: powder.dry_off_lines is empty");
  add(!powder.dry_off_lines.empty(), !powder.dry_on_lines.empty(),
      "nothing is switched on before a layer dries: powder.dry_on_lines is empty");
  const double dries_s = maintenance.spit_seconds > 0 ? maintenance.spit_seconds : maintenance.wipe_seconds;
  add(dries_s > 0 && powder.dry_s > dries_s, maintenance.cap_mm.has_value(),
      fmt::format("nozzles wait uncapped for {:g} s while a layer dries, and maintenance.{} is {:g}: give maintenance.cap_mm",
                  powder.dry_s, maintenance.spit_seconds > 0 ? "spit_seconds" : "wipe_seconds", dries_s));
  if (!idle.empty()) warnings.push_back({"maintenance", fmt::format("{}: {}", machine.name, idle)});
}

}  // namespace lamina::program
