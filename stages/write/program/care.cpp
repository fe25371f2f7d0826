#include "stages/write/program/care.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/write/program/program_text.h"

namespace lamina::write {
namespace {

using Place = std::array<double, 2>;

// Speeds are written in whole mm a minute, and firmware rounds as well.
constexpr double kOfLimit = 0.97;
// What dialects add to a sweep at either end, beside its ramps: the HP45 controller's rows and measures of speed.
constexpr double kRunUpMm = 20;

// The least of kPlainDigits.
constexpr double kLeastPlain = 1e-3;

/// Commands that programs have, or that end them: nobody may put them between.
constexpr std::string_view kOfPrograms[] = {"M0",   "M1",   "M2",   "M3",   "M4",   "M5",   "M25",  "M30",  "M112", "M226",
                                            "M400", "M578", "M999", "M810", "M811", "M812", "M813", "M814", "M815", "M816"};

double move_seconds(const Machine& machine, double way_mm, double speed_mm_s) {
  if (speed_mm_s * 60 >= 1) speed_mm_s = std::round(speed_mm_s * 60) / 60;  // as it is spelt
  const double a = machine.motion.acceleration_mm_s2;
  if (a == 0) return way_mm / speed_mm_s;
  return way_mm < speed_mm_s * speed_mm_s / a ? 2 * std::sqrt(way_mm / a) : way_mm / speed_mm_s + speed_mm_s / a;
}

double way(Place from, Place to) { return std::hypot(to[0] - from[0], to[1] - from[1]); }

double spit_seconds(const Machine& machine) { return machine.care.spit_drops / machine.head.highest_frequency_hz; }

/// The box of the bed that the nozzles are over with the carriage at a place, mm.
struct Under {
  Place low, high;
  void add(const Under& other) {
    for (std::size_t i = 0; i < 2; ++i) low[i] = std::min(low[i], other.low[i]), high[i] = std::max(high[i], other.high[i]);
  }
};

Under under_head(const Machine& machine, const HeadGrid& grid, Place carriage) {
  const std::size_t along = grid.scan_axis == ScanAxis::kX ? 0 : 1, across = 1 - along;
  Under box{};
  for (std::size_t i = 0; i < 2; ++i) box.low[i] = box.high[i] = carriage[i] - machine.mounting.offset_mm[i];
  const double row = (grid.nozzles - 1.0) * grid.passes * (grid.line_position_nm(1) - grid.line_position_nm(0)) / kNmPerMm;
  const double lag = -static_cast<double>(grid.most_lag) * (grid.step_position_nm(1) - grid.step_position_nm(0)) / kNmPerMm;
  box.low[across] += std::min(row, 0.0), box.high[across] += std::max(row, 0.0);
  box.low[along] += std::min(lag, 0.0), box.high[along] += std::max(lag, 0.0);
  return box;
}

bool over_bed(const Machine& machine, const HeadGrid& grid, const Under& box) {
  const double margin = std::max(grid.line_nm, grid.place_nm) / kNmPerMm;
  for (std::size_t i = 0; i < 2; ++i) {
    if (box.high[i] < -margin || box.low[i] > machine.bed.size_mm[i] + margin) return false;
  }
  return true;
}

/// One profile against one dialect.
class Checker {
 public:
  Checker(const Dialect& dialect, const Machine& machine, const HeadGrid& grid)
      : dialect_(dialect), machine_(machine), care_(machine.care), grid_(grid) {}

  Status check() {
    if (Status status = check_words(); !status) return status;
    if (Status status = check_places(); !status) return status;
    if (Status status = check_wiper_alone(); !status) return status;
    if (Status status = check_clock("care.spit_seconds", care_.spit_seconds, care_.spit_mm, 0); !status) return status;
    if (!care_.wipes()) return {};
    const Place wiped{(*care_.wipe_mm)[2], (*care_.wipe_mm)[3]};
    if (!care_.spits()) return check_clock("care.wipe_seconds", care_.wipe_seconds, wiped, 0);
    const double shot =
        move_seconds(machine_, way(wiped, *care_.spit_mm), machine_.motion.travel_speed_mm_s) + spit_seconds(machine_);
    return check_clock("care.wipe_seconds", care_.wipe_seconds, care_.spit_mm, shot);
  }

 private:
  Error wrong(std::string_view key, const std::string& what) const {
    return {Fault::kUsage, fmt::format("{}: {}: {}", machine_.name, key, what)};
  }

  Status check_words() const {
    const auto& powder = machine_.powder;
    const bool depths = std::ranges::any_of(powder.vat_depth_mm, [](double mm) { return mm > 0; });
    const struct {
      std::string_view key;
      bool asked;
      std::uint32_t says;
    } rows[] = {{"powder.base_layers", powder.base_layers > 0, kSaysBase},
                {"powder.refill", powder.refill == VatRefill::kPause, kSaysRefill},
                {"powder.dry_s", powder.dry_s > 0, kSaysDry},
                {"powder.roller_rpm", powder.roller_rpm > 0, kSaysRoller},
                {care_.spit_layers > 0 ? "care.spit_layers" : "care.spit_seconds", care_.spits(), kSaysCare},
                {care_.wipe_layers > 0 ? "care.wipe_layers" : "care.wipe_seconds", care_.wipes(), kSaysCare},
                {"powder.dry_on_lines", !powder.dry_on_lines.empty(), kSaysOwn},
                {"powder.dry_off_lines", !powder.dry_off_lines.empty(), kSaysOwn},
                {"care.wipe_lines", !care_.wipe_lines.empty(), kSaysOwn},
                {"care.spit_seconds", care_.spit_seconds > 0, kSaysSeconds},
                {"care.wipe_seconds", care_.wipe_seconds > 0, kSaysSeconds}};
    for (const auto& [key, asked, says] : rows) {
      if (!asked || (dialect_.says & says) == says) continue;
      return wrong(key, fmt::format("programs of the dialect {} cannot say it; leave it to the host, with its time in "
                                    "powder.pause_s and its drops in cost.spit_drops",
                                    dialect_.id));
    }
    for (const auto& [key, value] :
         {std::pair("powder.dry_s", powder.dry_s), std::pair("powder.roller_rpm", powder.roller_rpm)}) {
      if (value > 0 && value < kLeastPlain) return wrong(key, fmt::format("{:g} is written as 0; give at least 0.001", value));
    }
    if (Status status = check_own("powder.dry_on_lines", powder.dry_on_lines, powder.dry_s > 0); !status) return status;
    if (Status status = check_own("powder.dry_off_lines", powder.dry_off_lines, powder.dry_s > 0); !status) return status;
    if (Status status = check_own("care.wipe_lines", care_.wipe_lines, true); !status) return status;
    if (powder.refill == VatRefill::kPause && !depths) return wrong("powder.refill", "pauses need powder.vat_depth_mm");
    if (care_.spits() && !care_.spit_mm) return wrong("care.spit_mm", "is missing; give the carriage's place beside the bed");
    if (care_.wipes() && !care_.wipe_mm) return wrong("care.wipe_mm", "is missing; give x, y of both ends of the wiper");
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

  /// A wiper that lies where the head travels, and as fast: nobody can tell a wipe from a way to another place.
  Status check_wiper_alone() const {
    const auto& motion = machine_.motion;
    if (!care_.wipes() || feed_text(care_.wipe_speed_mm_s) != feed_text(motion.travel_speed_mm_s)) return {};
    const auto& [x, y, to_x, to_y] = *care_.wipe_mm;
    const std::optional<Place> places[] = {motion.safe_mm, care_.spit_mm, care_.cap_mm};
    for (const auto& from : places) {
      for (const auto& to : places) {
        if (!from || !to || way({x, y}, *from) + way({to_x, to_y}, *to) >= 1e-3) continue;
        return wrong("care.wipe_mm", "the head travels there as fast anyway; give another wiper, or care.wipe_speed_mm_s");
      }
    }
    return {};
  }

  Status check_places() const {
    const auto check = [&](std::string_view key, const Under& box) -> Status {
      if (!over_bed(machine_, grid_, box)) return {};
      return wrong(key, fmt::format("nozzles are over the bed there, x {:.2f} to {:.2f} and y {:.2f} to {:.2f} mm of it; give "
                                    "the carriage a place beside it",
                                    box.low[0], box.high[0], box.low[1], box.high[1]));
    };
    if (care_.spit_mm) {
      if (Status status = check("care.spit_mm", under_head(machine_, grid_, *care_.spit_mm)); !status) return status;
    }
    if (care_.cap_mm) {
      if (Status status = check("care.cap_mm", under_head(machine_, grid_, *care_.cap_mm)); !status) return status;
    }
    if (!care_.wipe_mm) return {};
    const auto& [x, y, to_x, to_y] = *care_.wipe_mm;
    Under box = under_head(machine_, grid_, {x, y});
    box.add(under_head(machine_, grid_, {to_x, to_y}));
    if (way({x, y}, {to_x, to_y}) < 1e-3) return wrong("care.wipe_mm", "the head does not move there; give another end");
    return check("care.wipe_mm", box);
  }

  /// Whether the longest sweep ends in time. from  where the head goes to it after so many seconds
  Status check_clock(std::string_view key, double limit_s, const std::optional<Place>& from, double after_s) const {
    if (limit_s == 0) return {};
    const auto& motion = machine_.motion;
    const auto& [width, depth] = machine_.bed.size_mm;
    const double room = motion.ramp_mm + kRunUpMm + static_cast<double>(grid_.most_lag) * grid_.step_nm() / kNmPerMm +
                        grid_.swath_lines() * grid_.line_nm / kNmPerMm;
    double farthest = 0;
    for (const double x : {-room, width + room}) {
      for (const double y : {-room, depth + room}) {
        farthest = std::max(farthest, way(*from, {x + machine_.mounting.offset_mm[0], y + machine_.mounting.offset_mm[1]}));
      }
    }
    const double needed =
        after_s + move_seconds(machine_, farthest, motion.travel_speed_mm_s) +
        move_seconds(machine_,
                     static_cast<double>(grid_.steps()) * grid_.step_nm() / kNmPerMm + 2 * (motion.ramp_mm + kRunUpMm),
                     motion.scan_speed_mm_s);
    if (needed < kOfLimit * limit_s) return {};
    return wrong(key, fmt::format("{:g} s, and a sweep ends up to {:.2f} s later; give more, or move faster", limit_s, needed));
  }

  const Dialect& dialect_;
  const Machine& machine_;
  const Machine::Care& care_;
  const HeadGrid& grid_;
};

}  // namespace

Status check_care(const Dialect& dialect, const Machine& machine, const HeadGrid& grid) {
  return Checker(dialect, machine, grid).check();
}

std::string idle_care(const Machine& machine) {
  const auto& care = machine.care;
  const auto& powder = machine.powder;
  const bool pauses = powder.dry_s > 0 || powder.refill == VatRefill::kPause;
  const bool shot = care.spit_mm || care.spit_drops != Machine::Care().spit_drops;
  std::string idle;
  const auto add = [&](bool said, bool asked, std::string_view what) {
    if (said && !asked) idle += fmt::format("{}{}", idle.empty() ? "" : "; ", what);
  };
  add(shot, care.spits(), "no shot: care.spit_layers and care.spit_seconds are 0");
  add(care.wipe_mm || !care.wipe_lines.empty(), care.wipes(), "no wipe: care.wipe_layers and care.wipe_seconds are 0");
  add(care.cap_mm.has_value(), pauses, "no pause under care.cap_mm: powder.dry_s is 0 and powder.refill no \"pause\"");
  return idle.empty() ? idle : fmt::format("{}: {}", machine.name, idle);
}

void Care::go(std::string_view command, double x_mm, double y_mm, double speed_mm_s, ProgramBytes& out) const {
  put(out, "{} {}{} {}{} F{}\n", command, machine_.motion.x_axis, mm_text(x_mm), machine_.motion.y_axis, mm_text(y_mm),
      feed_text(speed_mm_s));
}

void Care::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) put(out, "{}\n", line);
}

double Care::seconds(Place from, Place to, double speed_mm_s) const {
  return move_seconds(machine_, way(from, to), speed_mm_s);
}

double Care::sweep_seconds(Place from, Place to) const {
  return seconds(at_, from, machine_.motion.travel_speed_mm_s) + seconds(from, to, machine_.motion.scan_speed_mm_s);
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
  const auto& care = machine_.care;
  const auto due = [&](std::uint32_t layers, double seconds) {
    return seconds > 0 || (layers > 0 && cycle.layer % layers == 0);
  };
  at_ = machine_.motion.safe_mm;
  serve(due(care.wipe_layers, care.wipe_seconds), due(care.spit_layers, care.spit_seconds), out);
}

void Care::before_sweep(Place from, Place to, ProgramBytes& out) {
  const auto& care = machine_.care;
  double now = sweep_seconds(from, to);
  const bool spit = care.spit_seconds > 0 && since_spit_ + now > kOfLimit * care.spit_seconds;
  if (spit) {  // the wiper waits for the shot as well
    const double travel = machine_.motion.travel_speed_mm_s;
    now = seconds(at_, *care.spit_mm, travel) + spit_seconds(machine_) + seconds(*care.spit_mm, from, travel) +
          seconds(from, to, machine_.motion.scan_speed_mm_s);
  }
  const bool wipe = care.wipe_seconds > 0 && since_wipe_ + now > kOfLimit * care.wipe_seconds;
  serve(wipe, spit, out);
  const double taken = sweep_seconds(from, to);
  since_wipe_ += taken;
  since_spit_ += taken;
  at_ = to;
}

// A wiper leaves binder and grains at the nozzles, which firing takes away.
void Care::serve(bool wipe, bool spit, ProgramBytes& out) {
  const auto& care = machine_.care;
  const auto& motion = machine_.motion;
  if (wipe) {
    const auto& [x, y, to_x, to_y] = *care.wipe_mm;
    go(words_.travel, x, y, motion.travel_speed_mm_s, out);
    go("G1", to_x, to_y, care.wipe_speed_mm_s, out);
    if (!care.wipe_lines.empty()) put(out, "{}", words_.wait);
    put_own(care.wipe_lines, out);
    at_ = {to_x, to_y};
    since_wipe_ = 0;
  }
  if (spit || (wipe && care.spits())) {
    go(words_.travel, (*care.spit_mm)[0], (*care.spit_mm)[1], motion.travel_speed_mm_s, out);
    put(out, "{}", words_.wait);
    words_.spit(machine_, out);
    since_wipe_ += seconds(at_, *care.spit_mm, motion.travel_speed_mm_s) + spit_seconds(machine_);
    at_ = *care.spit_mm;
    since_spit_ = 0;
  } else if (wipe) {
    put(out, "{}", words_.wait);
  }
}

void Care::dry(ProgramBytes& out) const {
  if (machine_.powder.dry_s == 0) return;
  const Place at = machine_.care.cap_mm.value_or(machine_.motion.safe_mm);
  go(words_.travel, at[0], at[1], machine_.motion.travel_speed_mm_s, out);
  put(out, "{}", words_.wait);
  put_own(machine_.powder.dry_on_lines, out);
  put(out, "{}{}\n", words_.dwell,
      plain_text(machine_.powder.dry_s / words_.dwell_unit_s, words_.dwell_unit_s < 1 ? 0 : kPlainDigits));
  put_own(machine_.powder.dry_off_lines, out);
}

}  // namespace lamina::write
