#include "stages/program/care/care_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/program/care/care.h"
#include "stages/program/program_text.h"

namespace lamina::write {
namespace {

using Place = std::array<double, 2>;

// What dialects add to a sweep at either end, beside its ramps: the HP45 controller's rows and measures of speed.
constexpr double kRunUpMm = 20;

// The least of kPlainDigits.
constexpr double kLeastPlain = 1e-3;

/// Commands that programs have, or that end them: nobody may put them between.
constexpr std::string_view kOfPrograms[] = {"M0",   "M1",   "M2",   "M3",   "M4",   "M5",   "M25",  "M30",  "M112", "M226",
                                            "M400", "M578", "M999", "M810", "M811", "M812", "M813", "M814", "M815", "M816"};

double way(Place from, Place to) { return std::hypot(to[0] - from[0], to[1] - from[1]); }

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
    if (dialect_.care.own_places) return {};
    if (Status status = check_places(); !status) return status;
    if (Status status = check_wiper_alone(); !status) return status;
    if (Status status = check_clock("care.spit_seconds", care_.spit_seconds, care_.spit_mm, 0); !status) return status;
    if (!care_.wipes()) return {};
    const Place wiped{(*care_.wipe_mm)[2], (*care_.wipe_mm)[3]};
    if (!care_.spits()) return check_clock("care.wipe_seconds", care_.wipe_seconds, wiped, 0);
    const double shot = move_seconds(machine_, way(wiped, *care_.spit_mm), machine_.motion.travel_speed_mm_s) + shot_s();
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
                {care_.spit_layers > 0 ? "care.spit_layers" : "care.spit_seconds", care_.spits(), kSaysShots},
                {care_.wipe_layers > 0 ? "care.wipe_layers" : "care.wipe_seconds", care_.wipes(), kSaysWipes},
                {"powder.dry_on_lines", !powder.dry_on_lines.empty(), kSaysOwn},
                {"powder.dry_off_lines", !powder.dry_off_lines.empty(), kSaysOwn},
                {"care.wipe_lines", !care_.wipe_lines.empty(), kSaysOwn},
                {"care.cap_mm", care_.cap_mm.has_value(), kSaysCap},
                {"care.spit_seconds", care_.spit_seconds > 0, kSaysSeconds},
                {"care.wipe_seconds", care_.wipe_seconds > 0, kSaysSeconds}};
    for (const auto& [key, asked, says] : rows) {
      if (!asked || (dialect_.says & says) == says) continue;
      return wrong(key, fmt::format("programs of the dialect {} cannot say it (docs/print_program.md has why); leave "
                                    "it to the host, with its time in powder.pause_s and its drops in cost.spit_drops",
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

  /// Records of places are whole nm of 32 bits.
  Status check_reach() const {
    constexpr double kMostMm = 2147;
    const auto beyond = [](const auto& place) {
      return place && std::ranges::any_of(*place, [](double mm) { return std::abs(mm) > kMostMm; });
    };
    for (const auto& [key, is] : {std::pair("care.spit_mm", beyond(care_.spit_mm)),
                                  {"care.wipe_mm", beyond(care_.wipe_mm)},
                                  {"care.cap_mm", beyond(care_.cap_mm)}}) {
      if (is && !dialect_.has_motion) return wrong(key, fmt::format("{} has places up to {:g} mm", dialect_.id, kMostMm));
    }
    return {};
  }

  Status check_places() const {
    if (Status status = check_reach(); !status) return status;
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
    const double sweep_s =
        dialect_.care.longest_sweep_s != nullptr
            ? dialect_.care.longest_sweep_s(machine_, grid_)
            : move_seconds(machine_,
                           static_cast<double>(grid_.steps()) * grid_.step_nm() / kNmPerMm + 2 * (motion.ramp_mm + kRunUpMm),
                           motion.scan_speed_mm_s);
    const double needed = after_s + move_seconds(machine_, farthest, motion.travel_speed_mm_s) + sweep_s;
    if (needed < kOfCareLimit * limit_s) return {};
    return wrong(key, fmt::format("{:g} s, and a sweep ends up to {:.2f} s later; give more, or move faster", limit_s, needed));
  }

  double shot_s() const { return dialect_.care.shot_s != nullptr ? dialect_.care.shot_s(machine_) : shot_seconds(machine_); }

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
  const auto add = [&](bool said, bool asked, const std::string& what) {
    if (said && !asked) idle += fmt::format("{}{}", idle.empty() ? "" : "; ", what);
  };
  add(shot, care.spits(), "no shot: care.spit_layers and care.spit_seconds are 0");
  add(care.wipe_mm || !care.wipe_lines.empty(), care.wipes(), "no wipe: care.wipe_layers and care.wipe_seconds are 0");
  add(care.cap_mm.has_value(), pauses, "no pause under care.cap_mm: powder.dry_s is 0 and powder.refill no \"pause\"");
  add(!powder.dry_on_lines.empty(), !powder.dry_off_lines.empty(),
      "what powder.dry_on_lines switch on stays on: powder.dry_off_lines is empty");
  add(!powder.dry_off_lines.empty(), !powder.dry_on_lines.empty(),
      "nothing is switched on before a layer dries: powder.dry_on_lines is empty");
  const double dries_s = care.spit_seconds > 0 ? care.spit_seconds : care.wipe_seconds;
  add(dries_s > 0 && powder.dry_s > dries_s, care.cap_mm.has_value(),
      fmt::format("nozzles wait uncapped for {:g} s while a layer dries, and care.{} is {:g}: give care.cap_mm", powder.dry_s,
                  care.spit_seconds > 0 ? "spit_seconds" : "wipe_seconds", dries_s));
  return idle.empty() ? idle : fmt::format("{}: {}", machine.name, idle);
}

}  // namespace lamina::write
