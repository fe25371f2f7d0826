// stages/write/program/care.h: lines of a layer that keep nozzles from drying and vats from running empty.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "stages/write/program/dialect.h"

namespace lamina::write {

/// Whether a dialect can say what a profile asks for beside drops and powder, and whether it can be done: places off the bed,
/// limits in seconds that the longest sweep keeps. errors  kUsage, with the key and what to do
Status check_care(const Dialect& dialect, const Machine& machine, const HeadGrid& grid);

/// Empty, or what a profile has places for and asks for never.
std::string idle_care(const Machine& machine);

/// How a dialect spells it.
struct CareWords {
  std::string_view travel;                                  // the command of a movement beside the bed
  void (*spit)(const Machine& machine, ProgramBytes& out);  // all nozzles that are not blocked, where the head stands
  std::string_view wait;                                    // a line behind movements, "" if none is needed
  std::string_view refill;                                  // the lines of a pause for the vats to be filled
  std::string_view dwell;                                   // "G4 P" ...
  double dwell_unit_s = 1;                                  // ... and what its number counts
};

/// Writes the care of one layer after the other; a layer's lines depend on that layer alone.
class Care {
 public:
  /// machine and words outlive this object
  Care(const Machine& machine, const CareWords& words) : machine_(machine), words_(words) {}

  /// Before the powder of a layer.
  void refill(const LayerCycle& cycle, ProgramBytes& out);
  /// Behind it: what is due every so many layers, and by the clock, which begins here.
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out);
  /// Before the head goes to a sweep: what would be overdue at its end. from, to  of the sweep, mm of the carriage, x and y
  void before_sweep(std::array<double, 2> from, std::array<double, 2> to, ProgramBytes& out);
  /// Behind the last sweep.
  void dry(ProgramBytes& out) const;

 private:
  void serve(bool wipe, bool spit, ProgramBytes& out);
  void put_own(const std::vector<std::string>& lines, ProgramBytes& out) const;
  void go(std::string_view command, double x_mm, double y_mm, double speed_mm_s, ProgramBytes& out) const;
  double seconds(std::array<double, 2> from, std::array<double, 2> to, double speed_mm_s) const;
  /// Travels and the sweep itself.
  double sweep_seconds(std::array<double, 2> from, std::array<double, 2> to) const;

  const Machine& machine_;
  const CareWords& words_;
  std::array<double, 2> at_{};              // of the carriage
  double since_spit_ = 0, since_wipe_ = 0;  // seconds
};

}  // namespace lamina::write
