#include "stages/write/program/brundlefab/brundlefab.h"

#include <algorithm>

#include "stages/write/program/program_text.h"

namespace lamina::write::brundlefab {
namespace {

class Writer final : public ProgramWriter {
 public:
  Writer(const Machine& machine, const HeadGrid& grid) : machine_(machine), carriage_(machine, grid) {}

  void start(std::uint32_t, ProgramBytes& out) override { put(out, "G21\nG90\nT0\nG28 X0 Y0\n"); }

  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put(out, "M117 Slice {} of {}\nT21\n", cycle.layer + 1, cycle.layers);
    put_powder_cycle(machine_, cycle, out);
  }

  // A move with T1 jets its dots at every step that it ends on or passes, not at the one where it begins.
  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    const std::string& along = carriage_.scan_axis();
    const int ahead = sweep.backward ? -1 : 1;
    put(out, "T0\nG0 {}{} {}{} F{}\n", along, mm_text(carriage_.begin(sweep, vectors)), carriage_.line_axis(),
        mm_text(carriage_.across(sweep.first_line)), feed_text(machine_.motion.travel_speed_mm_s));
    std::int64_t at = INT64_MIN / 2;         // the step where the head is; far from all at first
    const std::uint64_t* pending = nullptr;  // jetted by the move to `at`, which is not written yet
    std::uint64_t now[2] = {0, 0};
    const auto flush = [&] {
      if (pending != nullptr) put(out, "G1 {}{} F{}\n", along, mm_text(carriage_.along(static_cast<double>(at))), speed());
      pending = nullptr;
    };
    for_each_vector(sweep, vectors, [&](std::uint32_t step, const std::uint64_t* words) {
      const std::int64_t next = step;
      const std::uint64_t two[2] = {words[0], vectors.words > 1 ? words[1] : 0};
      if (pending != nullptr && next == at + ahead && two[0] == now[0] && two[1] == now[1]) {
        at = next;
        return;
      }
      flush();
      if (next != at + ahead) {
        put(out, "G0 {}{}\n", along, mm_text(carriage_.along(static_cast<double>(next - ahead))));
      }
      now[0] = two[0];
      now[1] = two[1];
      const std::uint64_t mask = (1u << 24) - 1;
      put(out, "T1 P{} Q{} R{} S1\n", now[0] & mask, now[0] >> 24 & mask, (now[0] >> 48 | now[1] << 16) & mask);
      pending = words;
      at = next;
    });
    flush();
    put(out, "T0\nG0 {}{}\n", along, mm_text(carriage_.end(sweep, vectors)));
  }

  void end_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    put(out, "T0\nG0 {}{} {}{} F{}\nM117 Done {}\n", machine_.motion.x_axis, mm_text(machine_.motion.safe_mm[0]),
        machine_.motion.y_axis, mm_text(machine_.motion.safe_mm[1]), feed_text(machine_.motion.travel_speed_mm_s),
        cycle.layer + 1);
  }
  void end(ProgramBytes& out) override { put(out, "T0\nM117 Done\n"); }

 private:
  std::string speed() const { return feed_text(machine_.motion.scan_speed_mm_s); }
  const Machine& machine_;
  Carriage carriage_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<Writer>(machine, grid);
}

}  // namespace lamina::write::brundlefab
