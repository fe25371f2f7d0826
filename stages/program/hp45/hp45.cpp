#include "stages/program/hp45/hp45.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "stages/program/maintenance.h"
#include "stages/program/writers.h"

namespace lamina::program::hp45 {
namespace {

constexpr MaintenanceWords kMaintenance{"G1", Head::spit, Head::kWait, "", "", 1};

class Hp45Writer final : public ProgramWriter {
 public:
  Hp45Writer(const Machine& machine, const HeadGrid& grid)
      : machine_(machine), head_(machine, grid), maintenance_(machine, kMaintenance) {}

  void start(std::uint32_t, ProgramBytes& out) override {
    put(out, "G21\nG90\n");
    put_base_zero(machine_, out);
  }
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    head_.settings(out);
    put_powder_cycle(machine_, cycle, out);
    maintenance_.begin_layer(cycle, out);
  }
  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    head_.sweep(sweep, vectors, maintenance_, out);
  }
  void end_layer(const LayerCycle&, ProgramBytes& out) override {
    put_move(machine_, "G1", machine_.motion.safe_mm, machine_.motion.travel_speed_mm_s, out);
    Head::wait(out);
    put(out, "BRL\n");
  }
  void end(ProgramBytes& out) override { put(out, "BCL\n"); }

 private:
  const Machine& machine_;
  Head head_;
  MaintenanceWriter maintenance_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<Hp45Writer>(machine, grid);
}

namespace {

constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr double kUmPerInch = 25'400;
constexpr double kDpi = 600;                // of the cartridge's nozzles, and of bursts at a density of 100 %
constexpr std::uint32_t kNozzles = 300;     // of the cartridge
constexpr double kHalfRowGapUm = 2025;      // from the centre to either row (Position.ino: ROW_GAP)
constexpr std::uint32_t kSpeedCounts = 50;  // of the encoder that one measure of speed takes; the first after rest is wrong
// Position.ino forgets the speed 100 ms after its last measure, of 50 counts: nothing fires below 500 counts a second.
constexpr double kMinCountsPerSecond = 600;
constexpr std::int64_t kMaxProduct = 2'000'000'000;  // of micrometres and counts an inch in 32 bits
constexpr std::uint32_t kMaxPrimed = 25'000;         // HP45_Standalone_V4.ino cuts the bursts of PRM there
constexpr std::uint32_t kLines = 3950;               // the host stops at 50 free lines of 4000

// Of the profile: the firmware's tables (DMAPrint.cpp) give them the address and primitive of another one. Drops of the first
// three fall on lines of others; seven never fire, and where nozzles fire as one, the others of their group do.
constexpr std::uint32_t kWithoutChannel[] = {0, 129, 263, 6, 56, 115, 127, 167, 256, 291};
constexpr std::size_t kMisplaced = 3;

/// A whole number in base 64, the highest digit first, a minus before it if it is negative.
std::string number(std::int64_t value) {
  std::string digits;
  const bool negative = value < 0;
  for (auto left = static_cast<std::uint64_t>(negative ? -value : value); digits.empty() || left != 0; left >>= 6) {
    digits.insert(digits.begin(), kDigits[left & 63]);
  }
  return negative ? "-" + digits : digits;
}

/// Micrometres that the controller turns into exactly so many counts, 0 or more: its map() rounds towards zero in Arduino's
/// core and to the nearest in Teensy's (PaulStoffregen/cores @9beda59, teensy3/wiring.h), which is wrong below 0 and beyond 32
/// bits.
std::int64_t um_of_counts(std::int64_t counts, std::uint32_t per_inch) {
  return static_cast<std::int64_t>(std::ceil(static_cast<double>(counts) * kUmPerInch / per_inch - 1e-9));
}

bool whole(double value) { return std::abs(value - std::round(value)) < 1e-6; }

/// Whether edges of pixels can be distinguished: they are on counts, or a count is well below a pixel.
bool resolves(double counts_per_inch, double pixel_um) {
  const double counts = pixel_um * counts_per_inch / kUmPerInch;
  return counts >= 1.25 || (counts > 0.5 && whole(counts));
}

/// The profile's; if it has none, the least multiple of 600 that its pixels need.
std::uint32_t encoder_counts(const Machine& machine, double pixel_um) {
  if (machine.motion.encoder_dpi > 0) return static_cast<std::uint32_t>(std::lround(machine.motion.encoder_dpi));
  std::uint32_t counts = 600;
  while (!resolves(counts, pixel_um) && counts < 24'000) counts += 600;
  return counts;
}

/// A nozzle that has to be blocked and is not; kNozzles if there is none.
std::uint32_t fires_elsewhere(const HeadGrid& grid, std::uint32_t repeat) {
  for (std::size_t i = 0; i < (repeat > 1 ? kMisplaced : std::size(kWithoutChannel)); ++i) {
    const std::uint32_t nozzle = kWithoutChannel[i] / repeat;
    if (nozzle < grid.nozzles && !std::ranges::binary_search(grid.blocked, nozzle)) return nozzle;
  }
  return kNozzles;
}

/// Nozzles of the cartridge that fire as one, for profiles of 300, 200, 150, ... npi.
std::uint32_t repeat_of(const Machine& machine) {
  const double repeat = machine.head.pitch_um * kDpi / kUmPerInch;
  const bool fits = std::abs(repeat - std::round(repeat)) < 1e-3 && machine.head.nozzles * repeat < kNozzles + 0.5;
  return repeat > 1.5 && fits ? static_cast<std::uint32_t>(std::lround(repeat)) : 1;
}

}  // namespace

Status check(const Machine& machine, const HeadGrid& grid) {
  const auto wrong = [&](std::string_view key, std::string_view what) { return wrong_key(machine, key, what); };
  const auto& rows = machine.head.row_offset_um;
  if (std::ranges::any_of(rows, [](double offset) { return offset != 0; })) {
    return wrong("head.row_offset_um", "the HP45 controller fires its rows where they belong; give [0]");
  }
  const std::uint32_t repeat = repeat_of(machine);
  if (const std::uint32_t nozzle = fires_elsewhere(grid, repeat); nozzle < kNozzles) {
    return wrong("head.blocked",
                 fmt::format("the HP45 controller cannot fire nozzle {}, its tables give it another one's channel; name {} as "
                             "far as the head has them",
                             nozzle,
                             repeat > 1 ? fmt::format("{}, {} and {}", kWithoutChannel[0] / repeat, kWithoutChannel[1] / repeat,
                                                      kWithoutChannel[2] / repeat)
                                        : "0, 6, 56, 115, 127, 129, 167, 256, 263, 291"));
  }
  if (grid.steps_per_pixel != 1) return wrong("motion.lag_unit", "the HP45 controller fires by pixels; give pixel");
  if (grid.steps() + 2 > kLines) {
    return wrong("bed.size_mm", fmt::format("a sweep of {} steps; the HP45 controller stores {} lines", grid.steps(), kLines));
  }
  const double pixel_um = grid.step_nm() / 1000, counts = machine.motion.encoder_dpi;
  if (counts > 0 && (!whole(counts) || !resolves(counts, pixel_um))) {
    return wrong("motion.encoder_dpi",
                 fmt::format("{:g} counts an inch do not resolve pixels of {:.2f} um; give whole counts, one or more a pixel",
                             counts, pixel_um));
  }
  const double speed = machine.motion.scan_speed_mm_s,
               minimum = kMinCountsPerSecond * kUmPerInch / 1000 / encoder_counts(machine, pixel_um);
  if (speed < minimum || !whole(speed)) {
    return wrong("motion.scan_speed_mm_s",
                 fmt::format("{:g} mm/s; the HP45 controller takes speeds in whole mm/s and forgets those below {:.0f} with "
                             "this encoder, where nothing fires; give {:.0f} or a higher whole number",
                             speed, std::ceil(minimum), std::ceil(std::max(speed, minimum))));
  }
  return {};
}

Head::Head(const Machine& machine, const HeadGrid& grid)
    : machine_(machine),
      grid_(grid),
      carriage_(machine, grid),
      counts_(encoder_counts(machine, grid.step_nm() / 1000)),
      repeat_(repeat_of(machine)) {}

void Head::settings(ProgramBytes& out) const {
  const double density = 100 * kUmPerInch / (kDpi * grid_.step_nm() / 1000);
  put(out, "SPME\nSER {}\nSDP {}\nSDN {}\nSSID A\nBMOD A\n", number(counts_), number(static_cast<int>(kDpi) / repeat_),
      number(std::max<std::int64_t>(1, std::llround(density))));
}

void Head::line(double encoder_um, const std::uint64_t* words, std::uint32_t count, ProgramBytes& out) const {
  const std::uint32_t bits = kNozzles / repeat_, characters = (bits + 5) / 6;
  unsigned char six[kNozzles / 6] = {};  // the value of each character
  // The controller reads from the end: its nozzle 299 is the profile's nozzle 0.
  for (std::uint32_t i = 0; i < std::min({grid_.nozzles, bits, count * 64}); ++i) {
    const std::uint32_t bit = bits - 1 - i;
    six[characters - 1 - bit / 6] |= static_cast<unsigned char>((words[i / 64] >> (i % 64) & 1) << bit % 6);
  }
  std::string text(characters, kDigits[0]);
  for (std::uint32_t c = 0; c < characters; ++c) text[c] = kDigits[six[c]];
  put(out, "SBR {} {}\n", number(std::llround(encoder_um)), text);
}

void Head::spit(const Machine& machine, ProgramBytes& out) {
  for (std::uint32_t left = machine.maintenance.spit_drops; left > 0; left -= std::min(left, kMaxPrimed)) {
    put(out, "PRM {}\n", number(std::min(left, kMaxPrimed)));
  }
  put(out, "BCL\n");  // answered when the last burst is fired, as PRM is not
}

void Head::sweep(const Sweep& sweep, const SweepVectors& vectors, MaintenanceWriter& maintenance, ProgramBytes& out) const {
  const double step_um = grid_.step_nm() / 1000, count_um = kUmPerInch / counts_;
  const double ahead = sweep.backward == grid_.positions_from_end ? 1 : -1;  // of the carriage
  const std::uint32_t last = vectors.first_step + vectors.steps - 1;
  const auto before = [&](std::uint32_t step) { return carriage_.along(step) * 1000 - ahead * step_um / 2; };
  const auto after = [&](std::uint32_t step) { return before(step) + ahead * step_um; };
  // The run-up brings both rows to the first edge at full speed, with the speed measured; whole counts, so that edges of all
  // sweeps lie alike on the encoder.
  const double ramp_um = machine_.motion.ramp_mm * 1000;
  const double run_um = std::max(ramp_um, (2 * kSpeedCounts + 1) * count_um) + kHalfRowGapUm + step_um;
  const double first_edge = before(sweep.backward ? last : vectors.first_step);
  const double start = first_edge - ahead * std::ceil(run_um / count_um) * count_um;
  const double end =
      after(sweep.backward ? vectors.first_step : last) + ahead * (std::max(ramp_um, 2 * count_um) + kHalfRowGapUm);
  auto zero = static_cast<std::int64_t>(std::llround(start / count_um));
  if (zero < 0 || um_of_counts(zero, counts_) > kMaxProduct / counts_) zero = 0;  // any count does that all lines start from
  const auto encoder = [&](double um) { return static_cast<double>(zero) * count_um + um - start; };

  maintenance.before_sweep(
      {carriage_.position(start / 1000, sweep.first_line), carriage_.position(end / 1000, sweep.first_line)}, out);
  put(out, "G1 {}{} {}{} F{}\n", carriage_.scan_axis(), mm_text(start / 1000), carriage_.line_axis(),
      mm_text(carriage_.across(sweep.first_line)), feed_text(machine_.motion.travel_speed_mm_s));
  wait(out);
  put(out, "BCL\nSEP {}\n", number(um_of_counts(zero, counts_)));
  line(encoder(first_edge - ahead * step_um), nullptr, 0, out);
  const std::uint64_t* shown = nullptr;  // the vector that fires at present
  double shown_to = first_edge;
  for_each_vector(sweep, vectors, [&](std::uint32_t step, const std::uint64_t* words) {
    const bool gap = std::abs(before(step) - shown_to) > step_um / 2;
    if (gap && shown != nullptr) line(encoder(shown_to), nullptr, 0, out);
    if (gap || shown == nullptr || !std::equal(words, words + vectors.words, shown)) {
      line(encoder(before(step)), words, vectors.words, out);
    }
    shown = words;
    shown_to = after(step);
  });
  line(encoder(shown_to), nullptr, 0, out);
  put(out, "G1 {}{} F{}\n", carriage_.scan_axis(), mm_text(end / 1000), feed_text(machine_.motion.scan_speed_mm_s));
  wait(out);
}

}  // namespace lamina::program::hp45
