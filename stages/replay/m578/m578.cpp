// A layer's program as RepRapFirmware carries it out (github.com/Duet3D/RepRapFirmware, tags 1.09r to 3.4.6; taken out in
// c781c362). stages/program/m578/README.md has the format.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>

#include "stages/replay/gcode.h"

namespace lamina::replay {
namespace {

constexpr std::uint32_t kInkjetBits = 12;    // INKJET_BITS of Platform.h, a constant in all versions
constexpr double kSecondsOfNozzle = 805e-6;  // INKJET_FIRE_MICROSECONDS + INKJET_DELAY_MICROSECONDS, one after the other

/// Ways are added up: a place that is gone to again differs in its last bits.
bool apart(double at, double from) { return std::abs(at - from) > 1e-6; }

/// Whether the next movement along the scan goes to greater places; false if none follows before the next sweep.
bool goes_up(GcodeReader ahead, char along, double from) {
  GcodeLine line;
  while (ahead.next(line) && line.command != "G0") {
    if (line.command == "G1" && line.has(along) && apart(line.word.at(along), from)) return line.word.at(along) > from;
  }
  return false;
}

/// Whether a version has the case 578 of GCodes::HandleMcode.
bool has_m578(std::string_view version) {
  if (!version.empty() && (version[0] < '0' || version[0] > '9')) return false;
  const auto number = [](std::string_view digits) {
    int value = 0;
    std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return value;
  };
  const std::size_t dot = version.find('.');
  const int major = number(version), minor = dot == std::string_view::npos ? 0 : number(version.substr(dot + 1));
  return major < 3 || (major == 3 && minor < 5);
}

/// Whether the carriage stands where the head fires off the bed.
bool outside_bed(Axes& axes, const Machine& profile) {
  const auto& position = profile.maintenance.spit_mm;
  return position && profile.maintenance.spits() && std::abs(axes.at(profile.motion.x_axis) - (*position)[0]) < 1e-3 &&
         std::abs(axes.at(profile.motion.y_axis) - (*position)[1]) < 1e-3;
}

/// A shot off the bed: every nozzle that is not blocked, one after the other.
void spit_inkjet(const GcodeLine& line, GcodeReader& reader, Axes& axes, Printing& printing) {
  const Machine& profile = printing.profile();
  const std::uint32_t bits = reader.count(line, 'S');
  for (std::uint32_t bit = 0; bit < profile.head.nozzles; ++bit) {
    const bool blocked = std::ranges::find(profile.head.blocked, bit) != profile.head.blocked.end();
    if ((bits >> bit & 1) == (blocked ? 0u : 1u)) continue;
    return reader.fault(fmt::format("M578 S{} off the bed {} nozzle {}", bits, blocked ? "fires blocked" : "leaves out", bit));
  }
  printing.spits(axes.at(profile.motion.x_axis), axes.at(profile.motion.y_axis), 1, std::popcount(bits) * kSecondsOfNozzle);
}

/// Waits for standstill, reads S and no P (GCodes::HandleMcode), and fires the nozzles of its lowest bits one after the
/// other (Platform::Inkjet).
void fire_inkjet(const GcodeLine& line, GcodeReader& reader, Printing& printing) {
  if (!has_m578(printing.profile().firmware)) {
    return reader.fault(fmt::format("RepRapFirmware {} has no M578", printing.profile().firmware));
  }
  if (line.has('P')) return reader.fault("M578 ignores P: the first head fires, regardless of the one that is meant");
  const std::uint32_t bits = reader.count(line, 'S');
  if (bits >> kInkjetBits != 0) {
    return reader.fault(fmt::format("M578 S{} fires nozzles 0 to {} alone", bits, kInkjetBits - 1));
  }
  std::uint64_t word = 0;
  for (std::uint32_t bit = 0; bit < kInkjetBits; ++bit) word |= std::uint64_t{bits >> bit & 1} << (63 - bit);
  printing.fire_words({&word, 1});
  printing.takes(std::popcount(bits) * kSecondsOfNozzle);
}

}  // namespace

void read_m578(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  const ScanAxes scan(printing.profile());
  std::uint32_t sweep = 0;
  bool in_sweep = false, ended = false;
  double begin = 0;
  std::int64_t step = INT64_MIN;
  while (reader.next(line)) {
    if (ended) return reader.fault("continues after M400");
    if (line.command == "M578" && !in_sweep && outside_bed(axes, printing.profile())) {
      spit_inkjet(line, reader, axes, printing);
    } else if (line.command == "M226") {
      printing.refills();
    } else if (line.command == "G4") {
      printing.dwells(reader.number(line, 'P') / 1000);
    } else if (line.command == "M578") {
      const double at = axes.at(scan.along);
      if (!in_sweep) printing.reading_sweep(sweep);
      const std::int64_t now = printing.step_at(at);
      if (!in_sweep) {
        const bool towards_end = printing.position_of(1) > printing.position_of(0);
        // Without a ramp the first drop falls where the sweep begins.
        const bool up = apart(at, begin) ? at > begin : goes_up(reader, scan.along[0], at);
        printing.begin_sweep(sweep++, up != towards_end);
        printing.go_across(axes.at(scan.across));
        in_sweep = true;
        step = INT64_MIN;
      }
      if (now != step) printing.at_step(now);
      step = now;
      fire_inkjet(line, reader, printing);
    } else if (line.command == "M400") {
      axes.end();
      ended = true;
    } else {
      if (line.command == "G0") in_sweep = false;
      if (!axes.take(line, in_sweep)) return reader.fault(fmt::format("'{}' is no command of the dialect m578", line.command));
      if (line.command == "G0" && line.has(scan.along[0])) begin = axes.at(scan.along);
    }
  }
  if (!ended) return printing.fault("the program ends before M400");
}

}  // namespace lamina::replay
