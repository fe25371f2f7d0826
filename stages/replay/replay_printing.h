// stages/replay/replay_printing.h: a layer being printed by the virtual machine; what the parsers of dialects drive.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "stages/replay/replay.h"

namespace lamina::pipeline {

/// Throws a std::string, the fault, where the program does what it must not; replay.cpp turns it into an error.
class Printing {
 public:
  Printing(const VirtualMachine& machine, std::uint32_t layer, const VirtualMachine::Watch* watch);

  const Machine& profile() const { return machine_.machine_; }
  std::uint32_t layer() const { return layer_; }
  std::uint32_t nozzles() const { return static_cast<std::uint32_t>(machine_.nozzle_.size()); }
  std::int64_t steps_a_pixel() const { return machine_.ticks_; }
  /// "layer 12, swath 3, step 417: what"; before the first swath or the first step of one, that is said instead.
  [[noreturn]] void fault(const std::string& what) const;

  // --- sweeps
  void begin_sweep(std::uint32_t number, bool backward);
  /// Where nozzle 0 goes: a line, or a position of the carriage in mm.
  void go_to_line(std::int64_t line) { first_line_ = line; }
  void go_across(double carriage_mm);
  /// Carriage position in mm of a step, and the step nearest to a position, which has to be near.
  double position_of(double step) const;
  std::int64_t step_at(double carriage_mm) const;
  /// For messages: the sweep whose words are read before it begins, and the step of a vector that is not fired yet.
  void reading_sweep(std::uint32_t number) {
    reading_sweep_ = number;
    reading_ = INT64_MIN;
  }
  void reading_step(std::int64_t step) { reading_ = step; }
  void at_step(std::int64_t step);
  void fire(std::uint32_t nozzle);
  /// All nozzles whose bits are set; bit 63 of the first word is nozzle 0.
  void fire_words(const std::vector<std::uint64_t>& words);

  // --- what moves
  void head_moves(double mm, double mm_s, bool scanning);
  void feeds(std::uint32_t vat, double mm, double mm_s);
  void build_vat_stands_at(double mm);
  void roller_stands_at(double mm);
  void takes(double seconds) { count.seconds += seconds; }

  /// Whether the powder cycle was that of a layer; to be asked at the end.
  void check_cycle(const Layer& layer) const;
  /// Compares with an image; see VirtualMachine::replay.
  void compare(const RunsView& image, std::uint64_t moved, std::uint64_t lost);

  ReplayCount count;

 private:
  struct Sweep {
    std::uint32_t number;
    std::int64_t first_line;
  };
  std::int64_t line_of(std::uint32_t column, std::uint32_t row) const;
  bool pixel(std::int64_t line, std::int64_t place, std::uint32_t& column, std::uint32_t& row) const;
  std::string place_of(std::uint32_t column, std::uint32_t row) const;

  const VirtualMachine& machine_;
  const VirtualMachine::Watch* watch_;
  std::uint32_t layer_, row_words_;
  std::uint32_t sweep_ = 0;
  std::int64_t first_line_ = 0, step_ = 0, previous_step_ = 0;
  std::int64_t reading_ = INT64_MIN, reading_sweep_ = INT64_MIN;
  bool rolled_ = false;  // to the far end
  double roller_mm_ = 0;
  bool backward_ = false, sweeping_ = false, stepped_ = false, fired_here_ = false;
  std::vector<std::uint64_t> fired_;  // a bit a pixel, the leftmost in bit 0
  std::vector<Sweep> sweeps_;
};

/// Reads the program of a layer in each dialect.
void replay_nuferbj(std::string_view text, Printing& printing);
void replay_raw(std::string_view text, Printing& printing);
void replay_planes(std::string_view text, Printing& printing);
void replay_hp45(std::string_view text, Printing& printing);
void replay_brundlefab(std::string_view text, Printing& printing);
void replay_m578(std::string_view text, Printing& printing);

}  // namespace lamina::pipeline
