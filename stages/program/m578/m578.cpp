#include <bit>
#include <charconv>
#include <cmath>

#include "stages/program/maintenance.h"
#include "stages/program/program_text.h"
#include "stages/program/writers.h"

namespace lamina::program::m578 {
namespace {

// Platform.h: INKJET_FIRE_MICROSECONDS and INKJET_DELAY_MICROSECONDS of each nozzle, one after the other.
constexpr double kSecondsOfNozzle = (5 + 800) * 1e-6;
constexpr std::uint32_t kInkjetBits = 0xFFF;

void put_spit(const Machine& machine, ProgramBytes& out) {
  const std::uint32_t all = working_nozzles(machine);
  for (std::uint32_t drop = 0; drop < machine.maintenance.spit_drops; ++drop) put(out, "M578 S{}\n", all);
}

constexpr MaintenanceWords kMaintenance{"G0", put_spit, "", "; fill the vats, then resume\nM226\n", "G4 P", 1e-3, shot_s};

class M578Writer final : public ProgramWriter {
 public:
  M578Writer(const Machine& machine, const HeadGrid& grid)
      : machine_(machine), carriage_(machine, grid), maintenance_(machine, kMaintenance) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    put(out, "; print program of {}, {} layers, for RepRapFirmware 1.09r to 3.4 built with SUPPORT_INKJET\nG21\nG90\n",
        machine_.name, layers);
    put_base_zero(machine_, out);
  }
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put(out, "; layer {} of {}\n", cycle.layer, cycle.layers);
    maintenance_.refill(cycle, out);
    put_powder_cycle(machine_, cycle, out);
    maintenance_.begin_layer(cycle, out);
  }

  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    if (machine_.maintenance.spit_seconds > 0 || machine_.maintenance.wipe_seconds > 0) {
      maintenance_.before_sweep(carriage_.ends(sweep, vectors), out, sweep_s(sweep, vectors));
    }
    put(out, "; swath {} of {}\nG0 {}{} {}{} F{}\n", sweep.number, sweep.of, carriage_.scan_axis(),
        mm_text(carriage_.begin(sweep, vectors)), carriage_.line_axis(), mm_text(carriage_.across(sweep.first_line)),
        feed_text(machine_.motion.travel_speed_mm_s));
    const std::string speed = feed_text(machine_.motion.scan_speed_mm_s);
    for_each_vector(sweep, vectors, [&](std::uint32_t step, const std::uint64_t* words) {
      put(out, "G1 {}{} F{}\n", carriage_.scan_axis(), mm_text(carriage_.along(step)), speed);
      put(out, "M578 S{}\n", words[0] & kInkjetBits);  // 12 nozzles: INKJET_BITS
    });
    put(out, "G1 {}{} F{}\n", carriage_.scan_axis(), mm_text(carriage_.end(sweep, vectors)), speed);
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    maintenance_.dry(out);
    put_move(machine_, "G0", machine_.motion.safe_mm, machine_.motion.travel_speed_mm_s, out);
    put(out, "M400\n; end of layer {}\n", cycle.layer);
  }
  void end(ProgramBytes& out) override { put(out, "M400\nM0\n"); }

 private:
  /// A stop, and a shot, at each step that fires.
  double sweep_s(const Sweep& sweep, const SweepVectors& vectors) const {
    const double speed = machine_.motion.scan_speed_mm_s;
    double at = carriage_.begin(sweep, vectors), seconds = 0;
    for_each_vector(sweep, vectors, [&](std::uint32_t step, const std::uint64_t* words) {
      const double to = carriage_.along(step);
      seconds += move_seconds(machine_, std::abs(to - at), speed) + std::popcount(words[0] & kInkjetBits) * kSecondsOfNozzle;
      at = to;
    });
    return seconds + move_seconds(machine_, std::abs(carriage_.end(sweep, vectors) - at), speed);
  }

  const Machine& machine_;
  Carriage carriage_;
  MaintenanceWriter maintenance_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<M578Writer>(machine, grid);
}

double shot_s(const Machine& machine) {
  return machine.maintenance.spit_drops * std::popcount(working_nozzles(machine)) * kSecondsOfNozzle;
}

double longest_sweep_s(const Machine& machine, const HeadGrid& grid) {
  const double speed = machine.motion.scan_speed_mm_s;
  return static_cast<double>(grid.steps()) * (move_seconds(machine, grid.step_nm() / kNmPerMm, speed) +
                                              std::popcount(working_nozzles(machine)) * kSecondsOfNozzle) +
         2 * move_seconds(machine, machine.motion.ramp_mm, speed);
}

Status check(const Machine& machine, const HeadGrid&) {
  if (machine.firmware.empty()) return {};
  int major = 0, minor = 0;
  const char* const end = machine.firmware.data() + machine.firmware.size();
  if (machine.firmware[0] < '0' || machine.firmware[0] > '9') {
    return wrong_key(machine, "machine.firmware",
                     fmt::format("'{}' begins with no number; give RepRapFirmware's version alone, as 2.03", machine.firmware));
  }
  const auto dot = std::from_chars(machine.firmware.data(), end, major).ptr;
  if (dot != end && *dot == '.') std::from_chars(dot + 1, end, minor);
  if (major < 3 || (major == 3 && minor < 5)) return {};
  return wrong_key(machine, "machine.firmware",
                   fmt::format("RepRapFirmware {} has no M578; it was removed for 3.5", machine.firmware));
}

}  // namespace lamina::program::m578
