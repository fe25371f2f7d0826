// Programs of the dialects hp45 and oasis (stages/program/): a host sends G-code to the motion controller and the rest
// to the HP45 controller, and waits at G4.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <optional>
#include <vector>

#include "stages/replay/gcode.h"
#include "stages/replay/hp45/controller.h"

namespace lamina::replay {
namespace {

constexpr double kClearanceMm =
    0.25;                           // SerialGRBL.py, NewLayer: the pistons stand so far nearer to the spreader than layers say
constexpr int kMaxBusyTravels = 8;  // over lines that are not done; hosts have none
constexpr int kMaxRewinds = 8;      // BRES reads up to 4000 lines again; hosts have none
constexpr double kBurstsPerInch = 600;
// Of the profile: DMAPrint.cpp gives them another one's address and primitive, so that their drops fall on its line.
constexpr std::uint32_t kMisplaced[] = {0, 129, 263};

constexpr double kMarginMm = 100;  // off the bed, besides ramps
// PositionUpdate measures the speed every 50 counts (POSITION_STEP_COUNT); 100 ms behind the last measure it is 0
// (POSITION_STEP_TIMEOUT), and bursts need one. It is held in whole mm/s.
constexpr double kMinCountsPerSecond = 500;
constexpr std::uint32_t kMaxPrimed = 25'000;  // HP45_Standalone_V4.ino, PRM: constrain()

/// Bursts of PRM; none if the controller would fire others.
std::optional<std::uint32_t> primed(std::string_view number) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::uint32_t bursts = 0;
  for (const char c : number) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos || bursts > kMaxPrimed) return std::nullopt;
    bursts = bursts * 64 + static_cast<std::uint32_t>(digit);
  }
  if (bursts > kMaxPrimed) return std::nullopt;
  return bursts;
}

/// encoder_dpi  of the profile; 0: not stated
/// errors       kVerification: an encoder of so many counts an inch is not the machine's
Status check_encoder(double counts, double encoder_dpi, double step_um) {
  if (counts == encoder_dpi) return {};
  if (encoder_dpi <= 0) {  // 600, or what pixels need
    if (counts <= 600 + 2 * 25'400 / step_um) return {};
    return Error{Fault::kVerification,
                 fmt::format("SER has {:g} counts an inch, far more than pixels of {:.1f} um need", counts, step_um)};
  }
  return Error{Fault::kVerification,
               fmt::format("SER has {:g} counts an inch, the machine's encoder {:g}", counts, encoder_dpi)};
}

/// Whether the carriage gets to a place along the scan: the bed with ramps and clearance, where the head waits or is
/// maintained, and the spreader's ends if the gantry has it.
bool reaches(const Printing& printing, double counts_per_inch, double mm) {
  const auto& profile = printing.profile();
  const std::string& along = ScanAxes(profile).along;
  const bool x = profile.mounting.scan_axis == ScanAxis::kX;
  const double begin = profile.mounting.offset_mm[x ? 0 : 1],
               offset = x ? printing.axis_positions().x_mm : printing.axis_positions().y_mm;
  double low = std::min(begin, offset), high = std::max(begin + profile.bed.size_mm[x ? 0 : 1], offset);
  if (profile.powder.roller_axis == along) {
    low = std::min({low, profile.powder.roller_mm[0], profile.powder.roller_mm[1]});
    high = std::max({high, profile.powder.roller_mm[0], profile.powder.roller_mm[1]});
  }
  // The run-up takes two measures of speed, of 50 counts each.
  if (const auto& maintenance = profile.maintenance; maintenance.spits() || maintenance.wipes() || maintenance.cap_mm) {
    const std::size_t i = x ? 0 : 1;
    for (const auto& position : {maintenance.spit_mm, maintenance.cap_mm}) {
      if (position) low = std::min(low, (*position)[i]), high = std::max(high, (*position)[i]);
    }
    if (maintenance.wipe_mm) {
      low = std::min({low, (*maintenance.wipe_mm)[i], (*maintenance.wipe_mm)[2 + i]});
      high = std::max({high, (*maintenance.wipe_mm)[i], (*maintenance.wipe_mm)[2 + i]});
    }
  }
  const double row_mm = printing.nozzles() * profile.head.pitch_um / 1000;  // of a tilted head
  const double clearance = kMarginMm + row_mm + profile.motion.ramp_mm + 110 * 25.4 / counts_per_inch;
  return mm >= low - clearance && mm <= high + clearance;
}

/// errors  kVerification: the firmware does not know a sweep's speed all the way
Status check_speed(double mm_s, double counts_per_inch) {
  const double counts = mm_s / 25.4 * counts_per_inch;
  if (std::abs(mm_s - std::round(mm_s)) > 1e-3) {
    return Error{Fault::kVerification, fmt::format("sweeps at {:g} mm/s, which the controller cuts to whole mm/s", mm_s)};
  }
  if (counts >= kMinCountsPerSecond) return {};
  return Error{Fault::kVerification,
               fmt::format("sweeps at {:g} mm/s, {:.0f} counts a second: below {:.0f} the controller takes the head to rest",
                           mm_s, counts, kMinCountsPerSecond)};
}

class Hp45Reader {
 public:
  Hp45Reader(std::string_view text, Printing& printing, bool oasis)
      : printing_(printing),
        reader_(text, printing),
        axes_(printing, reader_),
        scan_(printing.profile()),
        controller_(axes_.at(scan_.along) * 1000),
        oasis_(oasis) {
    const double pitch = printing.position_of(1) - printing.position_of(0);
    step_um_ = std::abs(pitch) * 1000;
    grows_ = pitch > 0;
    const double repeat = printing.profile().head.pitch_um * kBurstsPerInch / 25'400;
    const bool fits =
        std::abs(repeat - std::round(repeat)) < 1e-3 && printing.nozzles() * repeat < hp45::kCartridgeNozzles + 0.5;
    repeat_ = repeat > 1.5 && fits ? static_cast<std::uint32_t>(std::lround(repeat)) : 1;
    words_ = (printing.nozzles() + 63) / 64;
  }

  void read();

 private:
  void command(const GcodeLine& line);
  void prime(std::string_view number);
  bool begins_well(double from_um, double to_um);
  void move(const GcodeLine& line);
  void spread(const GcodeLine& line);
  void pistons_came() {
    const auto& powder = printing_.profile().powder;
    printing_.pistons_came(axes_.last_way(powder.build_axis), axes_.last_way(powder.feed_axes[0]));
  }
  bool ready();
  Status own_encoder() const {
    return check_encoder(controller_.counts_per_inch(), printing_.profile().motion.encoder_dpi, step_um_);
  }
  void take_burst();
  void take_firing(const hp45::Controller::Firing& firing);
  void end_span(std::uint32_t row);
  void drop(bool sweeping, bool upwards);
  std::uint64_t drops() const;
  double step_of(double um) const { return (um / 1000 - printing_.position_of(0)) / (grows_ ? step_um_ : -step_um_) * 1000; }

  Printing& printing_;
  GcodeReader reader_;
  Axes axes_;
  const ScanAxes scan_;
  hp45::Controller controller_;
  bool oasis_, grows_ = true, moving_ = false, ended_ = false, spreading_ = false, spread_ = false;
  bool swept_ = false;   // and has not rested yet
  bool primes_ = false;  // or may still do so: no answer has come behind it
  double step_um_ = 0;
  std::uint32_t repeat_ = 1, words_ = 1, sweep_ = 0, lines_ = 0;
  int busy_travels_ = 0, rewinds_ = 0;
  struct Shot {  // of a row: the profile's nozzles, as Printing::fire_words takes them
    std::int64_t step;
    hp45::Burst words;
  };
  std::vector<Shot> shots_[2];         // of a movement, in its order
  std::uint64_t hurried_ = 0;          // bursts before the speed was measured
  bool begins_off_ = false;            // the first line of a sweep
  double begin_um_ = 0, ahead_ = 0;    // its place; 1 or -1, the way to the second one
  double first_um_ = 0, last_um_ = 0;  // of the head's centre where nozzles were on in a movement
  struct StepSpan {                    // of one line of a row
    std::uint32_t line = 0, steps = 0;
    double from_um = 0, to_um = 0;
    bool any = false;
  } interval_[2];
};

void Hp45Reader::read() {
  GcodeLine line;
  while (reader_.next(line)) {
    if (ended_) return reader_.fault("continues after BRL");
    if (line.command == "G4") {
      const double seconds = reader_.number(line, 'P');
      if (seconds > 0 && oasis_ && printing_.profile().powder.dry_s > 0) {
        printing_.dwells(seconds);
      } else if (seconds != 0) {
        return reader_.fault("G4 has P0: the host waits until nothing moves");
      }
      moving_ = swept_ = false;
      printing_.under_way(false);
    } else if (oasis_ && line.command == "M0") {
      printing_.refills();
    } else if (oasis_ && (line.command == "M4" || line.command == "M5")) {
      spread(line);
    } else if (line.command[0] == 'G') {
      move(line);
    } else {
      command(line);
    }
  }
  if (!ended_) printing_.fault("the program ends before BRL");
}

void Hp45Reader::command(const GcodeLine& line) {
  if (line.command == "SBR" && lines_ == 0) printing_.reading_sweep(sweep_);
  if (moving_) return reader_.fault(fmt::format("{} is sent while the head may still move; G4 P0 waits for it", line.command));
  if (line.command == "SBR" && !ready()) return;
  if (line.command == "BRES" && ++rewinds_ > kMaxRewinds) return reader_.fault("rewinds the buffer again and again");
  primes_ = line.command == "PRM";
  if (primes_) return prime(line.rest);
  if (const Status done = controller_.execute(line.command, line.rest); !done) return reader_.fault(done.error().message);
  if (line.command == "SBR") {
    const double at_um = controller_.true_um(controller_.last_position_um());
    if (++lines_ == 1) {
      begins_off_ = std::ranges::all_of(controller_.last_burst(), [](std::uint64_t word) { return word == 0; });
      begin_um_ = at_um;
    }
    if (lines_ == 2) ahead_ = at_um > begin_um_ ? 1 : -1;
    take_burst();
  } else if (line.command == "SER") {
    if (const Status encoder = own_encoder(); !encoder) reader_.fault(encoder.error().message);
  } else if (line.command == "BRL") {
    if (controller_.unread() > 0) {
      return reader_.fault(fmt::format("{} lines are left that the head has not come to", controller_.unread()));
    }
    if (!controller_.idle()) return reader_.fault("the last line is not all off, and fires on the moves of the next layer");
    if (oasis_ && (spreading_ || !spread_)) return reader_.fault("the layer has no powder spread between M4 and M5");
    if (oasis_) pistons_came();
    axes_.end();
    ended_ = true;
  }
}

// So many bursts of all nozzles, wherever the head stands. SerialCommand::Update answers before they are fired.
void Hp45Reader::prime(std::string_view number) {
  const auto bursts = primed(number);
  if (!bursts) return reader_.fault("PRM takes up to 25000 bursts, in base 64");
  const auto& profile = printing_.profile();
  printing_.spits(axes_.at(profile.motion.x_axis), axes_.at(profile.motion.y_axis), *bursts,
                  *bursts / profile.head.highest_frequency_hz);
}

// Whether lines can be fired as the profile has it: where the head stands, how fine the encoder, how many bursts.
bool Hp45Reader::ready() {
  const Status encoder = own_encoder();
  const double density = 100 * 25'400 / (kBurstsPerInch * step_um_);
  if (const std::string_view unset = controller_.unset(); !unset.empty()) {
    reader_.fault(fmt::format("lines come before {}: the controller keeps the values of another print", unset));
  } else if (!controller_.zeroed()) {
    reader_.fault("lines come before SEP sets the position of the head");
  } else if (!encoder) {
    reader_.fault(encoder.error().message);
  } else if (controller_.density() != std::max<std::int64_t>(1, std::llround(density))) {
    reader_.fault(fmt::format("SDN has {} %, where {:.0f} give a burst a pixel", controller_.density(), density));
  } else {
    return true;
  }
  return false;
}

// A line's nozzles have to be those of the profile, all of a group together, and none whose drops fall on another's line.
void Hp45Reader::take_burst() {
  const hp45::Burst& burst = controller_.last_burst();
  printing_.reading_step(std::llround(step_of(controller_.true_um(controller_.last_position_um()))));
  for (std::uint32_t position = 0; position < hp45::kCartridgeNozzles; ++position) {
    const auto bit = [&](std::uint32_t at) { return (burst[at / 64] >> (63 - at % 64) & 1) != 0; };
    if (!bit(position)) continue;
    const std::uint32_t nozzle = position / repeat_;
    if (nozzle >= printing_.nozzles()) return reader_.fault(fmt::format("nozzle {} does not exist", nozzle));
    for (std::uint32_t r = 0; r < repeat_; ++r) {
      if (!bit(nozzle * repeat_ + r)) return reader_.fault(fmt::format("nozzle {} is set in part; SDP is wrong", nozzle));
    }
    const auto& blocked = printing_.profile().head.blocked;
    if (std::ranges::find(kMisplaced, position) != std::end(kMisplaced) &&
        std::ranges::find(blocked, nozzle) != blocked.end()) {
      return reader_.fault(fmt::format("nozzle {} is set, which is blocked: its drops fall on another one's line", nozzle));
    }
  }
}

void Hp45Reader::move(const GcodeLine& line) {
  const bool sweeping = lines_ > 0, moves = line.command == "G1" || line.command == "G0";
  if (moves && swept_) {
    return reader_.fault(
        "the head moves on from a sweep without G4 P0, and the controller resets its speed and direction only at rest");
  }
  if (moves && primes_) {
    return reader_.fault("moves while PRM may still fire: the controller answers at once, and again after its last burst");
  }
  if (line.command == "G0") return reader_.fault("G0 moves as fast as the motion controller can, regardless of F");
  const double from = axes_.at(scan_.along), neighbour = axes_.at(scan_.across);
  if (!axes_.take(line, sweeping)) {
    return reader_.fault(fmt::format("'{}' is no command of the dialect {}", line.command, oasis_ ? "oasis" : "hp45"));
  }
  if (!moves) return;
  const auto& powder = printing_.profile().powder;
  if (spreading_ && (line.has(powder.build_axis[0]) || line.has(powder.feed_axes[0][0]))) {
    return reader_.fault("a piston moves while powder is spread");
  }
  moving_ = true;
  swept_ = sweeping;
  printing_.under_way(true);
  const double to = axes_.at(scan_.along);
  if (to == from || !printing_.ok()) return;
  if (!reaches(printing_, controller_.counts_per_inch(), to))
    return reader_.fault(fmt::format("moves to {:g} mm, out of the machine", to));
  if (!sweeping && !controller_.idle() && ++busy_travels_ > kMaxBusyTravels) {
    return reader_.fault("travels to and fro over lines that are not done");
  }
  const bool upwards = (to > from) == grows_;
  if (sweeping && !begins_well(from * 1000, to * 1000)) return;
  if (sweeping) {
    printing_.begin_sweep(sweep_++, !upwards);
    if (axes_.at(scan_.across) != neighbour) return reader_.fault("moves across while it fires");
    printing_.go_across(axes_.at(scan_.across));
    const Status speed = check_speed(axes_.speed_mm_s(), controller_.counts_per_inch());
    if (!speed) return reader_.fault(speed.error().message);
  }
  for (auto& shots : shots_) shots.clear();
  hurried_ = 0;
  first_um_ = last_um_ = std::nan("");
  controller_.move(to * 1000, [&](const hp45::Controller::Firing& firing) { take_firing(firing); });
  end_span(0);
  end_span(1);
  drop(sweeping, upwards);
  lines_ = 0;
  if (!sweeping || std::isnan(first_um_)) return;
  const double way = to > from ? 1 : -1, count_mm = 25.4 / controller_.counts_per_inch();
  printing_.has_ramps(way * (first_um_ / 1000 - from), way * (to - last_um_ / 1000), count_mm + 1e-3);
}

// BufferUpdateValues reads the first line at once after the controller was switched on, and when a row has come to it after
// another sweep. Nothing else may depend on which it is.
bool Hp45Reader::begins_well(double from_um, double to_um) {
  const double way = to_um > from_um ? 1 : -1;
  if (!begins_off_) {
    reader_.fault("the first line of the sweep is not all off, and may fire where the head rests");
  } else if (way * (begin_um_ - from_um) <= hp45::kHalfRowGapUm || (lines_ > 1 && ahead_ * way < 0)) {
    reader_.fault("the first line of the sweep is not ahead of both rows, or the second one not ahead of it");
  } else {
    return true;
  }
  return false;
}

// The steps whose places a row passes, once each.
void Hp45Reader::take_firing(const hp45::Controller::Firing& firing) {
  const double row = firing.row == 1 ? hp45::kHalfRowGapUm : -hp45::kHalfRowGapUm;
  const double way = firing.to_um > firing.from_um ? 1 : -1;
  if (std::isnan(first_um_) || way * (firing.from_um - row - first_um_) < 0) first_um_ = firing.from_um - row;
  if (std::isnan(last_um_) || way * (firing.to_um - row - last_um_) > 0) last_um_ = firing.to_um - row;
  StepSpan& now = interval_[firing.row];
  if (now.any && (now.line != firing.line || std::abs(firing.from_um - now.to_um) > 1e-3)) end_span(firing.row);
  if (!now.any) {
    now = {firing.line, 0, firing.from_um, firing.to_um, true};
    // The encoder's counts put the line's begin next to the edge of its step.
    const double begin = step_of(firing.from_um), neighbour = std::abs(begin - std::floor(begin) - 0.5) * step_um_;
    printing_.count.farthest_along_um = std::max(printing_.count.farthest_along_um, neighbour);
  }
  now.to_um = firing.to_um;
  if (!firing.steady) ++hurried_;
  const double from = step_of(firing.from_um), to = step_of(firing.to_um);
  const auto first = static_cast<std::int64_t>(std::ceil(std::min(from, to)));
  const auto end = static_cast<std::int64_t>(std::ceil(std::max(from, to)));
  const bool upwards = to > from;
  for (std::int64_t k = 0; k < end - first; ++k, ++now.steps) {
    const std::int64_t step = upwards ? first + k : end - 1 - k;
    Shot shot{step, {}};
    if (repeat_ == 1) {
      shot.words = *firing.burst;
      for (const std::uint32_t nozzle : kMisplaced) shot.words[nozzle / 64] &= ~(std::uint64_t{1} << (63 - nozzle % 64));
    }
    for (std::uint32_t position = 0; repeat_ > 1 && position < printing_.nozzles() * repeat_; ++position) {
      const std::uint32_t nozzle = position / repeat_;
      shot.words[nozzle / 64] |= ((*firing.burst)[position / 64] >> (63 - position % 64) & 1) << (63 - nozzle % 64);
    }
    shots_[firing.row].push_back(shot);
  }
}

// A line that is on for less than a step may fire or not: the firmware's bursts come by the clock.
void Hp45Reader::end_span(std::uint32_t row) {
  StepSpan& now = interval_[row];
  if (now.any && now.steps == 0) {
    printing_.reading_step(std::llround(step_of(now.from_um)));
    printing_.fault(fmt::format("nozzles are on for {:.0f} um, between two steps", std::abs(now.to_um - now.from_um)));
  }
  now = {};
}

std::uint64_t Hp45Reader::drops() const {
  std::uint64_t all = 0;
  for (const auto& shots : shots_) {
    for (const Shot& shot : shots) {
      for (const std::uint64_t word : shot.words) all += static_cast<std::uint64_t>(std::popcount(word));
    }
  }
  return all;
}

void Hp45Reader::drop(bool sweeping, bool upwards) {
  if (!printing_.ok()) return;
  if (!sweeping) {
    if (const std::uint64_t all = drops(); all > 0) printing_.fault(fmt::format("{} drops fall while the head travels", all));
    return;
  }
  if (hurried_ > 0) {
    return printing_.fault(
        "nozzles are on before the encoder has measured the speed, 100 counts after rest; the run-up is too short");
  }
  std::vector<std::uint64_t> words(words_);
  for (std::size_t odd = 0, even = 0; printing_.ok() && odd + even < shots_[0].size() + shots_[1].size();) {
    const Shot* const a = odd < shots_[0].size() ? &shots_[0][odd] : nullptr;
    const Shot* const b = even < shots_[1].size() ? &shots_[1][even] : nullptr;
    const std::int64_t step = a == nullptr   ? b->step
                              : b == nullptr ? a->step
                              : upwards      ? std::min(a->step, b->step)
                                             : std::max(a->step, b->step);
    const bool has_a = a != nullptr && a->step == step, has_b = b != nullptr && b->step == step;
    for (std::uint32_t w = 0; w < words_; ++w) words[w] = (has_a ? a->words[w] : 0) | (has_b ? b->words[w] : 0);
    odd += has_a;
    even += has_b;
    printing_.at_step(step);
    printing_.fire_words(words);
  }
}

// The spreader turns on the gantry, which spreads on its way to the far end.
void Hp45Reader::spread(const GcodeLine& line) {
  const auto& powder = printing_.profile().powder;
  printing_.spreads(axes_.at(powder.build_axis), printing_.count.fed_mm[0] + printing_.count.fed_mm[1], kClearanceMm);
  if (line.command == "M5") {
    if (std::abs(axes_.speed_mm_s() - powder.roller_speed_mm_s) > 1.01 * kHalfMmPerMinute) {
      printing_.wrong_powder(
          fmt::format("the spreader moves at {:g} mm/s where {:g} have to be", axes_.speed_mm_s(), powder.roller_speed_mm_s));
    }
    if (!spreading_) return reader_.fault("M5 stops a spreader that does not turn");
    spread_ = true;
    printing_.roller_is_at(axes_.at(powder.roller_axis));
    printing_.roller_turns(0);
    // On the gantry it does not touch the powder on the way back.
    if (powder.roller_axis == scan_.along || powder.roller_axis == scan_.across) printing_.roller_is_at(powder.roller_mm[0]);
  } else if (std::abs(axes_.at(powder.roller_axis) - powder.roller_mm[0]) > 1e-3) {
    return reader_.fault(
        fmt::format("the spreader starts at {:g} mm, not at {:g}", axes_.at(powder.roller_axis), powder.roller_mm[0]));
  } else {
    pistons_came();
  }
  spreading_ = line.command == "M4";
  if (line.has('S') && powder.roller_rpm == 0)
    return reader_.fault("M4 must not have S: the profile sets no speed of the roller");
  printing_.roller_turns(spreading_ && line.has('S') ? line.word.at('S') : 0);
}

}  // namespace

void read_hp45(std::string_view text, Printing& printing) { Hp45Reader(text, printing, false).read(); }
void read_oasis(std::string_view text, Printing& printing) { Hp45Reader(text, printing, true).read(); }

}  // namespace lamina::replay
