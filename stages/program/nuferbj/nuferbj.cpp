#include <algorithm>
#include <array>
#include <charconv>

#include "stages/program/maintenance.h"
#include "stages/program/program_text.h"
#include "stages/program/writers.h"

namespace lamina::program::nuferbj {
namespace {

/// The two hexadecimal digits of eight nozzles, the first one in the highest bit.
constexpr auto kDigits = [] {
  std::array<std::array<char, 2>, 256> digits{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned turned = 0;
    for (unsigned bit = 0; bit < 8; ++bit) turned |= (byte >> bit & 1) << (7 - bit);
    digits[byte] = {"0123456789ABCDEF"[turned >> 4], "0123456789ABCDEF"[turned & 15]};
  }
  return digits;
}();

void put_spit(const Machine& machine, ProgramBytes& out) { put(out, "M816 N{}\n", machine.maintenance.spit_drops); }

constexpr MaintenanceWords kMaintenance{"G0", put_spit, "", "M815\n", "G4 P", 1e-3};

class NuferbjWriter final : public ProgramWriter {
 public:
  NuferbjWriter(const Machine& machine, const HeadGrid& grid)
      : machine_(machine), grid_(grid), carriage_(machine, grid), maintenance_(machine, kMaintenance) {}

  void start(std::uint32_t layers, ProgramBytes& out) override {
    put(out, "; print program of {}, dialect nuferbj 1\n", machine_.name);
    put(out, "G21\nG90\nM810 L{} N{} W{} K{} Q{:.3f}\n", layers, grid_.nozzles, grid_.positions, grid_.steps_per_pixel,
        grid_.step_nm());
    put_base_zero(machine_, out);
  }

  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put(out, "M811 L{} T{} H{}\n", cycle.layer, cycle.layers, mm_text(static_cast<double>(cycle.thickness_nm) / kNmPerMm));
    maintenance_.refill(cycle, out);
    put_powder_cycle(machine_, cycle, out);
    maintenance_.begin_layer(cycle, out);
  }

  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    maintenance_.before_sweep(carriage_.ends(sweep, vectors), out);
    put(out, "M812 S{} T{} D{}\n", sweep.number, sweep.of, sweep.backward ? 1 : 0);
    put(out, "G0 {}{} {}{} F{}\n", carriage_.scan_axis(), mm_text(carriage_.begin(sweep, vectors)), carriage_.line_axis(),
        mm_text(carriage_.across(sweep.first_line)), feed_text(machine_.motion.travel_speed_mm_s));
    const std::uint64_t* before = nullptr;
    std::uint32_t before_step = 0, repeats = 0;
    const auto flush = [&] {
      if (repeats > 0) put(out, "R{}\n", repeats);
      repeats = 0;
    };
    for_each_vector(sweep, vectors, [&](std::uint32_t step, const std::uint64_t* words) {
      const bool next = before != nullptr && step == (sweep.backward ? before_step - 1 : before_step + 1);
      if (next && std::equal(words, words + vectors.words, before)) {
        ++repeats;
      } else {
        flush();
        put_vector(step, words, out);
      }
      before = words;
      before_step = step;
    });
    flush();
    put(out, "G1 {}{} F{}\n", carriage_.scan_axis(), mm_text(carriage_.end(sweep, vectors)),
        feed_text(machine_.motion.scan_speed_mm_s));
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    maintenance_.dry(out);
    put_move(machine_, "G0", machine_.motion.safe_mm, machine_.motion.travel_speed_mm_s, out);
    put(out, "M813 L{}\n", cycle.layer);
  }

  void end(ProgramBytes& out) override { put(out, "M814\n"); }

 private:
  // J<step> and a word of eight digits for every 32 nozzles.
  void put_vector(std::uint32_t step, const std::uint64_t* words, ProgramBytes& out) {
    const std::uint32_t groups = (grid_.nozzles + 31) / 32;
    const std::size_t at = out.size();
    out.resize(at + 12 + std::size_t{groups} * 9);
    char* text = reinterpret_cast<char*>(out.data()) + at;
    *text++ = 'J';
    text = std::to_chars(text, text + 10, step).ptr;
    for (std::uint32_t group = 0; group < groups; ++group) {
      const auto bits = static_cast<std::uint32_t>(words[group / 2] >> (group % 2 * 32));
      *text++ = ' ';
      for (unsigned byte = 0; byte < 4; ++byte) {
        const auto& digits = kDigits[bits >> (8 * byte) & 255];
        *text++ = digits[0];
        *text++ = digits[1];
      }
    }
    *text++ = '\n';
    out.resize(static_cast<std::size_t>(reinterpret_cast<std::byte*>(text) - out.data()));
  }

  const Machine& machine_;
  const HeadGrid& grid_;
  Carriage carriage_;
  MaintenanceWriter maintenance_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<NuferbjWriter>(machine, grid);
}

}  // namespace lamina::program::nuferbj
