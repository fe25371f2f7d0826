#include "stages/write/program/hp45/hp45.h"

#include <cmath>
#include <string>

#include "stages/write/program/program_text.h"

namespace lamina::write::hp45 {
namespace {

constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::uint32_t kCharacters = 50;  // of 6 nozzles each

/// A whole number in base 64, the highest digit first, a minus before it if it is negative.
std::string number(std::int64_t value) {
  std::string digits;
  const bool negative = value < 0;
  for (auto left = static_cast<std::uint64_t>(negative ? -value : value); digits.empty() || left != 0; left >>= 6) {
    digits.insert(digits.begin(), kDigits[left & 63]);
  }
  return negative ? "-" + digits : digits;
}

class Writer final : public ProgramWriter {
 public:
  Writer(const Machine& machine, const HeadGrid& grid) : machine_(machine), carriage_(machine, grid) {}

  void start(std::uint32_t, ProgramBytes& out) override { put(out, "G21\nG90\nBCL\n"); }
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override { put_powder_cycle(machine_, cycle, out); }

  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    put(out, "G1 {}{} {}{} F{}\nBCL\n", carriage_.scan_axis(), mm_text(carriage_.begin(sweep, vectors)), carriage_.line_axis(),
        mm_text(carriage_.across(sweep.first_line)), feed_text(machine_.motion.travel_speed_mm_s));
    for_each_vector(sweep, vectors, [&](std::uint32_t step, const std::uint64_t* words) {
      char characters[kCharacters];
      for (std::uint32_t c = 0; c < kCharacters; ++c) {
        unsigned value = 0;
        for (std::uint32_t i = 6 * c; i < 6 * c + 6; ++i) {
          value = value << 1 | (i / 64 < vectors.words ? static_cast<unsigned>(words[i / 64] >> (i % 64) & 1) : 0u);
        }
        characters[c] = kDigits[value];
      }
      put(out, "SBR {} {}\n", number(std::llround(carriage_.along(step) * 1000)), std::string_view(characters, kCharacters));
    });
    put(out, "G1 {}{} F{}\n", carriage_.scan_axis(), mm_text(carriage_.end(sweep, vectors)),
        feed_text(machine_.motion.scan_speed_mm_s));
  }

  void end_layer(const LayerCycle&, ProgramBytes& out) override {
    put(out, "G1 {}{} {}{} F{}\nBRES\n", machine_.motion.x_axis, mm_text(machine_.motion.safe_mm[0]), machine_.motion.y_axis,
        mm_text(machine_.motion.safe_mm[1]), feed_text(machine_.motion.travel_speed_mm_s));
  }
  void end(ProgramBytes& out) override { put(out, "BCL\n"); }

 private:
  const Machine& machine_;
  Carriage carriage_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<Writer>(machine, grid);
}

}  // namespace lamina::write::hp45
