#include <algorithm>
#include <array>
#include <cmath>

#include "stages/program/maintenance.h"
#include "stages/program/program_text.h"
#include "stages/program/writers.h"

namespace lamina::program::brundlefab {
namespace {

// fab/brundle.py: where the tools stand on the carriage, and how far the bins give way to it.
constexpr double kPenMm = 195, kBladeMm = 0, kFuserMm = 45, kThermometerMm = 95, kGiveWayMm = 2;
constexpr double kPartBinMm = 198, kWasteBinMm = 385;
// BrundleInk.ino: SCAN_WIDTH_DOT; Axis_DCEncoder.h: ink stops 9 ticks before a target, 1.44 dots.
constexpr std::int64_t kBarDots = 840, kBrakeDots = 2, kLastDot = kBarDots - 2 * kBrakeDots - 1;
constexpr double kDotMm = 25.4 / 96, kLongestXMm = 650, kLongestNumber = 32'767;
// config.h, Z_MM_MAX and E_MM_MAX: Axis_Stepper::update stops there, and at 0, without a word.
constexpr double kBinMm = 140;
// Dots that are sooner passed over, there and back, than the bar is wiped.
constexpr std::int64_t kWorthWiping = 24;

// BrundleInk.ino sprays in every second millisecond (time_after is strict); three a dot leave no dot out.
constexpr std::int64_t kFewestSprays = 3;

/// The S of T1: the firmware has no speed of the bar, but spends so many milliseconds on a dot.
std::int64_t sprays(const Machine& machine) {
  return std::max<std::int64_t>(1, std::llround(kDotMm * 1000 / machine.motion.scan_speed_mm_s));
}

/// Of one way along the bar.
double bar_seconds(const Machine& machine, std::int64_t dots) { return static_cast<double>(dots * sprays(machine)) * 1e-3; }

/// Dots of the bar that a shot takes, a drop a dot of each nozzle: kShotDots in one run there and back, or more runs.
constexpr std::int64_t kShotDots = kLastDot - kBrakeDots + 1;
double shot_s(const Machine& machine) {
  const std::int64_t drops = machine.maintenance.spit_drops, runs = (drops + kShotDots - 1) / kShotDots;
  return 2 * bar_seconds(machine, drops + runs * 2 * kBrakeDots);
}

class BrundlefabWriter final : public ProgramWriter {
 public:
  BrundlefabWriter(const Machine& machine, const HeadGrid& grid)
      : machine_(machine), carriage_(machine, grid), clock_(machine, shot_s(machine)) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    const std::string speed = feed_text(machine_.powder.roller_speed_mm_s);
    put(out, "M117 {} layers\n", layers);
    state(out);
    put(out, "G10 L1 P20 X{}\nG10 L1 P22 X{}\nM117 Ready to home\nM0\nG28 X0 Y0 E0\n", mm_text(kFuserMm),
        mm_text(kThermometerMm));
    // The feed bin does not go below 0, and gives way to the carriage in the first layer already.
    put(out, "G1 E{} F{}\n", mm_text(kGiveWayMm), vat_speed());
    put(out, "M117 Prep part\nT21\nM0\nG0 X{}\nM117 Levelling\nG1 X{} F{}\nM117 Fill feed bin\nM0\nM117\nT21\nG1 X{}\n",
        mm_text(kWasteBinMm), mm_text(kPartBinMm), speed, mm_text(machine_.powder.roller_mm[0]));
  }

  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put(out, "M117 Slice {} of {}\n", cycle.layer + 1, cycle.layers);
    state(out);
    put(out, "T21\n");
    wipe(out);
    for_each_spread(machine_, cycle, [&](std::int64_t bottom_nm, std::int64_t thickness_nm) {
      put_powder(thickness_nm, out);
      if (bottom_nm != cycle.bottom_nm) put_return(out);  // of the base
    });
    if (clock_.begin_layer(cycle.layer, {machine_.powder.roller_mm[1] + kPenMm, 0}).shot) shoot(out);
  }

  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    dots_.fill(0);
    std::int64_t last = 0;
    for_each_vector(sweep, vectors, [&](std::uint32_t step, const std::uint64_t* words) {
      const auto dot = std::llround(carriage_.along(step) / kDotMm - 0.5);
      if (dot < 0 || dot >= kBarDots) return;  // check() holds dots on the bar
      dots_[static_cast<std::size_t>(dot)] = static_cast<std::uint16_t>(words[0] & 0xFFF);
      last = std::max<std::int64_t>(last, dot);
    });
    const double across = carriage_.across(sweep.first_line);
    const MachinePoint position{across, 0};                  // the bar's home
    const std::int64_t end = band_end(last) + kWorthWiping;  // a shot before it may have been longer
    if (clock_.before_sweep({position, position}, 2 * bar_seconds(machine_, end)).shot) {
      const auto dots = dots_;
      shoot(out);
      dots_ = dots;
    }
    put_band(across, last, out);
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put(out, "T21\n");
    put_return(out);
    put(out, "M117 Done {}\n", cycle.layer + 1);
  }
  void end(ProgramBytes& out) override { put(out, "T0\nM117 Done\n"); }

 private:
  /// The state that a layer needs of the machine, after any earlier use. G10 L1 P1 sets tool 1 and, P being its pattern too,
  /// the pattern 1: T1 P0 follows.
  void state(ProgramBytes& out) const {
    put(out, "G21\nG90\nG10 L1 P0 X{}\nG10 L1 P1 X{}\nG10 L1 P21 X{}\nT1 P0 S{}\nG28 Y0\n", mm_text(kPenMm), mm_text(kPenMm),
        mm_text(kBladeMm), sprays(machine_));
  }

  // The bins give way by whole millimetres: the firmware reads -1.5 as -0.5 (GCode::_line_parse).
  void put_powder(std::int64_t thickness_nm, ProgramBytes& out) const {
    const double thickness = static_cast<double>(thickness_nm) / kNmPerMm;
    put(out, "G91\nG1 E{} Z{} F{}\nG90\n", mm_text(machine_.powder.dose * thickness), mm_text(thickness), vat_speed());
    put(out, "G1 X{} F{}\n", mm_text(machine_.powder.roller_mm[1]), feed_text(machine_.powder.roller_speed_mm_s));
    put(out, "G91\nG1 E{} Z{} F{}\nG90\n", mm_text(-kGiveWayMm), mm_text(kGiveWayMm), vat_speed());
  }

  /// The recoater to the feed bin, and the bins up.
  void put_return(ProgramBytes& out) const {
    put(out, "G0 X{}\nG91\nG1 E{} Z{} F{}\nG90\n", mm_text(machine_.powder.roller_mm[0]), mm_text(kGiveWayMm),
        mm_text(-kGiveWayMm), vat_speed());
  }

  /// The dots that a band with such a last one takes, those that it brakes over among them.
  std::int64_t band_end(std::int64_t last) const {
    const std::int64_t end = last + 1 + kBrakeDots;
    return longest_ - end > kWorthWiping ? end : std::max(end, longest_);
  }

  /// dots_, up to the last one, inked on the way there and back with the pen at x.
  void put_band(double x_mm, std::int64_t last, ProgramBytes& out) {
    put(out, "T0\n");
    std::int64_t end = last + 1 + kBrakeDots;
    if (longest_ - end > kWorthWiping) wipe(out);
    end = std::max(end, longest_);
    longest_ = end;
    put(out, "T1 P0\nG1 X{} F{}\n", mm_text(x_mm), feed_text(machine_.motion.travel_speed_mm_s));
    load(end, out);
    put(out, "T0\nT1 P0\nG0 Y0\n");
  }

  /// All nozzles that are not blocked, a drop a dot, next to the bed.
  void shoot(ProgramBytes& out) {
    const auto all = static_cast<std::uint16_t>(working_nozzles(machine_));
    for (std::int64_t left = machine_.maintenance.spit_drops; left > 0; left -= kShotDots) {
      const std::int64_t drops = std::min(left, kShotDots);
      dots_.fill(0);
      std::fill_n(dots_.begin() + kBrakeDots, drops, all);
      put_band((*machine_.maintenance.spit_mm)[0], kBrakeDots + drops - 1, out);
    }
  }

  // Overwrites what earlier bands left in the printhead's buffer, which 'k' does not clear: with no ink tool selected the
  // bar is loaded and discarded without moving.
  void wipe(ProgramBytes& out) {
    put(out, "G1 Y{}\nG0 Y0\n", y_text(kBarDots));
    longest_ = 0;
  }

  // Dots that fire are loaded one by one, and never two blank ones at a time: dotline_set_range of the printhead packs what
  // it repeats wrongly, and repeats nothing at an even dot.
  void load(std::int64_t end, ProgramBytes& out) const {
    std::uint16_t pattern = 0;
    for (std::int64_t dot = 0; dot < end;) {
      const std::uint16_t next = at(dot);
      std::int64_t behind = dot + 1;
      while (next == 0 && behind < end && at(behind) == 0) ++behind;
      if (next != pattern) put(out, "T1 P{}\n", next);
      pattern = next;
      if (behind - dot == 2) put(out, "G1 Y{}\n", y_text(dot + 1));
      put(out, "G1 Y{}\n", y_text(behind));
      dot = behind;
    }
  }
  std::uint16_t at(std::int64_t dot) const { return dots_[static_cast<std::size_t>(dot)]; }

  // The middle of a dot, since InkBar::target_set cuts off what is behind the point.
  static std::string y_text(std::int64_t dot) { return fmt::format("{:.2f}", (static_cast<double>(dot) + 0.5) * kDotMm); }
  std::string vat_speed() const { return feed_text(machine_.powder.vat_speed_mm_s); }

  const Machine& machine_;
  Carriage carriage_;
  MaintenanceClock clock_;
  std::array<std::uint16_t, kBarDots + kBrakeDots + 1> dots_{};
  std::int64_t longest_ = 0;  // the dots loaded since the bar was wiped
};

/// Whether the bins reach the last layer. returns  what does not fit, empty if all does
std::string wrong_bins(const Machine& machine) {
  constexpr double kLastLayerMm = 1;  // may end above the part
  const double height = machine.bed.build_height_mm + kLastLayerMm;
  const double base = machine.powder.base_mm();
  const double part = height + base + kGiveWayMm, feed = machine.powder.dose * (height + base) + kGiveWayMm;
  if (std::max(part, feed) <= kBinMm) return {};
  return fmt::format("the bins move by {:g} mm, and parts of {:g} mm{} take {:g} of the part bin and {:g} of the feed bin",
                     kBinMm, machine.bed.build_height_mm, base > 0 ? fmt::format(" on a base of {:g}", base) : "", part, feed);
}

/// The bar runs along the whole bed, for any Y: a shot has to be outside of it in X, and begins at the bar's home.
Status check_shots(const Machine& machine, const Carriage& carriage, const HeadGrid& grid) {
  const auto& maintenance = machine.maintenance;
  const auto wrong = [&](std::string_view key, std::string_view what) { return wrong_key(machine, key, what); };
  if (!maintenance.spits()) return {};
  const auto& [x, y] = *maintenance.spit_mm;
  if (y != 0) return wrong("maintenance.spit_mm", "the ink bar runs from its home along Y; give 0 for y");
  const double line = grid.line_nm / kNmPerMm, head = grid.swath_lines() * line;
  const double ends[] = {carriage.across(0), carriage.across(std::int64_t{grid.lines} - 1)};
  const double low = std::min(ends[0], ends[1]) - head, high = std::max(ends[0], ends[1]) + head;
  if (x > low && x < high) {
    return wrong(
        "maintenance.spit_mm",
        fmt::format("the bar runs over the bed at x {:.2f} to {:.2f} mm; give an x outside of it, as 400, over the waste bin",
                    low, high));
  }
  if (x < kPenMm || x >= kPenMm + kLongestXMm) {
    return wrong("maintenance.spit_mm", fmt::format("the pen reaches x {:g} to {:g} mm", kPenMm, kPenMm + kLongestXMm));
  }
  if (maintenance.spit_seconds == 0) return {};
  const double way = std::max(std::abs(x - low), std::abs(x - high));
  const double needed =
      move_seconds(machine, way, machine.motion.travel_speed_mm_s) + 2 * bar_seconds(machine, kBarDots + kBrakeDots);
  if (needed < kShareOfLimit * maintenance.spit_seconds) return {};
  return wrong(
      "maintenance.spit_seconds",
      fmt::format("{:g} s, and a band ends up to {:.2f} s later; give more, or move faster", maintenance.spit_seconds, needed));
}

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<BrundlefabWriter>(machine, grid);
}

Status check(const Machine& machine, const HeadGrid& grid) {
  const auto wrong = [&](std::string_view key, std::string_view what) { return wrong_key(machine, key, what); };
  const Carriage carriage(machine, grid);
  const auto& powder = machine.powder;
  if (carriage.scan_axis() != "Y" || carriage.line_axis() != "X" || powder.build_axis != "Z" || powder.feed_axes[0] != "E" ||
      powder.roller_axis != "X" || powder.build_sign != 1 || powder.feed_sign != 1) {
    return wrong("motion, powder",
                 "a BrundleFab has the axes X (bands, recoater), Y (ink bar), +Z (part bin) and +E (feed bin)");
  }
  if (const double maximum = std::max({machine.motion.travel_speed_mm_s, powder.roller_speed_mm_s, powder.vat_speed_mm_s});
      maximum * 60 > kLongestNumber) {
    return wrong("motion.travel_speed_mm_s",
                 fmt::format("F{:.0f} is more than the 16 bits of the firmware's numbers", maximum * 60));
  }
  if (const std::string bins = wrong_bins(machine); !bins.empty()) return wrong("bed.build_height_mm, powder.dose", bins);
  if (powder.vats != 1) return wrong("powder.vats", "a BrundleFab has one feed bin");
  if (std::abs(grid.step_nm() / kNmPerMm / kDotMm - 1) > 1e-4) {
    return wrong("mounting.along_dpi",
                 fmt::format("the ink bar has 96 dots an inch, the profile {:g} steps", 25.4 * kNmPerMm / grid.step_nm()));
  }
  const double first = carriage.along(0) / kDotMm - 0.5,
               last = carriage.along(static_cast<double>(grid.steps()) - 1) / kDotMm - 0.5;
  if (std::abs(first - std::round(first)) > 0.02) {
    return wrong("mounting.offset_mm", fmt::format("the ink bar's dots begin at its home, {:.2f} dots off those of the image",
                                                   first - std::round(first)));
  }
  if (std::llround(std::min(first, last)) < kBrakeDots || std::llround(std::max(first, last)) > kLastDot) {
    return wrong("bed.size_mm", fmt::format("dots {:.0f} to {:.0f} of the ink bar are needed, {} to {} can be inked: it has "
                                            "{}, and needs some to brake and turn over",
                                            std::min(first, last), std::max(first, last), kBrakeDots, kLastDot, kBarDots));
  }
  const double ends[] = {carriage.across(-std::int64_t{grid.swath_lines()}),
                         carriage.across(std::int64_t{grid.lines} + grid.swath_lines())};
  if (std::min(ends[0], ends[1]) < kPenMm || std::max(ends[0], ends[1]) >= kPenMm + kLongestXMm) {
    return wrong("mounting.offset_mm",
                 fmt::format("the pen reaches x {:g} to {:g} mm, the bands need {:.1f} to {:.1f}", kPenMm, kPenMm + kLongestXMm,
                             std::min(ends[0], ends[1]), std::max(ends[0], ends[1])));
  }
  if (const auto& [home, far] = powder.roller_mm; std::min(home, far) < 0 || std::max(home, far) >= kLongestXMm) {
    return wrong("powder.roller_mm", fmt::format("the recoater reaches x 0 to {:g} mm", kLongestXMm));
  }
  if (Status status = check_shots(machine, carriage, grid); !status) return status;
  if (sprays(machine) < kFewestSprays) {
    return wrong("motion.scan_speed_mm_s", fmt::format("the head sprays every 2 ms, and meets each dot at {:.1f} mm/s or less",
                                                       kDotMm * 1000 / kFewestSprays));
  }
  return {};
}

}  // namespace lamina::program::brundlefab
