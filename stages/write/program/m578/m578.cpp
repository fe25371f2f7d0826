#include "stages/write/program/m578/m578.h"

#include <algorithm>
#include <charconv>

#include "stages/write/program/care.h"
#include "stages/write/program/program_text.h"

namespace lamina::write::m578 {
namespace {

void put_spit(const Machine& machine, ProgramBytes& out) {
  std::uint32_t all = 0;
  for (std::uint32_t nozzle = 0; nozzle < machine.head.nozzles; ++nozzle) {
    if (std::ranges::find(machine.head.blocked, nozzle) == machine.head.blocked.end()) all |= 1u << nozzle;
  }
  for (std::uint32_t drop = 0; drop < machine.care.spit_drops; ++drop) put(out, "M578 S{}\n", all);
}

constexpr CareWords kCare{"G0", put_spit, "", "; fill the vats, then go on\nM226\n", "G4 P", 1e-3};

class Writer final : public ProgramWriter {
 public:
  Writer(const Machine& machine, const HeadGrid& grid) : machine_(machine), carriage_(machine, grid), care_(machine, kCare) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    put(out, "; print program of {}, {} layers, for RepRapFirmware 1.09r to 3.4 built with SUPPORT_INKJET\nG21\nG90\n",
        machine_.name, layers);
    put_base_zero(machine_, out);
  }
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put(out, "; layer {} of {}\n", cycle.layer, cycle.layers);
    care_.refill(cycle, out);
    put_powder_cycle(machine_, cycle, out);
    care_.begin_layer(cycle, out);
  }

  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    put(out, "; swath {} of {}\nG0 {}{} {}{} F{}\n", sweep.number, sweep.of, carriage_.scan_axis(),
        mm_text(carriage_.begin(sweep, vectors)), carriage_.line_axis(), mm_text(carriage_.across(sweep.first_line)),
        feed_text(machine_.motion.travel_speed_mm_s));
    const std::string speed = feed_text(machine_.motion.scan_speed_mm_s);
    for_each_vector(sweep, vectors, [&](std::uint32_t step, const std::uint64_t* words) {
      put(out, "G1 {}{} F{}\n", carriage_.scan_axis(), mm_text(carriage_.along(step)), speed);
      put(out, "M578 S{}\n", words[0] & 0xFFF);  // 12 nozzles: INKJET_BITS
    });
    put(out, "G1 {}{} F{}\n", carriage_.scan_axis(), mm_text(carriage_.end(sweep, vectors)), speed);
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    care_.dry(out);
    put(out, "G0 {}{} {}{} F{}\nM400\n; end of layer {}\n", machine_.motion.x_axis, mm_text(machine_.motion.safe_mm[0]),
        machine_.motion.y_axis, mm_text(machine_.motion.safe_mm[1]), feed_text(machine_.motion.travel_speed_mm_s), cycle.layer);
  }
  void end(ProgramBytes& out) override { put(out, "M400\nM0\n"); }

 private:
  const Machine& machine_;
  Carriage carriage_;
  Care care_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<Writer>(machine, grid);
}

Status check(const Machine& machine, const HeadGrid&) {
  if (machine.firmware.empty()) return {};
  int major = 0, minor = 0;
  const char* const end = machine.firmware.data() + machine.firmware.size();
  if (machine.firmware[0] < '0' || machine.firmware[0] > '9') {
    return Error{Fault::kUsage, fmt::format("{}: machine.firmware: '{}' begins with no number; give RepRapFirmware's version "
                                            "alone, as 2.03",
                                            machine.name, machine.firmware)};
  }
  const auto dot = std::from_chars(machine.firmware.data(), end, major).ptr;
  if (dot != end && *dot == '.') std::from_chars(dot + 1, end, minor);
  if (major < 3 || (major == 3 && minor < 5)) return {};
  return Error{Fault::kUsage, fmt::format("{}: machine.firmware: RepRapFirmware {} has no M578; it was removed for 3.5",
                                          machine.name, machine.firmware)};
}

}  // namespace lamina::write::m578
