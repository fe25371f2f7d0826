// stages/program/care/care.h: lines of G-code that keep nozzles from drying and vats from running empty.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "stages/program/care/care_clock.h"
#include "stages/program/dialect.h"

namespace lamina::write {

/// How a dialect spells it.
struct CareWords {
  std::string_view travel;                                  // the command of a movement beside the bed
  void (*spit)(const Machine& machine, ProgramBytes& out);  // all nozzles that are not blocked, where the head stands
  std::string_view wait;                                    // a line behind movements, "" if none is needed
  std::string_view refill;                                  // the lines of a pause for the vats to be filled
  std::string_view dwell;                                   // "G4 P" ...
  double dwell_unit_s = 1;                                  // ... and what its number counts
  double (*shot_s)(const Machine& machine) = shot_seconds;  // how long `spit` takes
};

/// Writes the care of one layer after the other; a layer's lines depend on that layer alone.
class Care {
 public:
  /// machine and words outlive this object
  Care(const Machine& machine, const CareWords& words)
      : machine_(machine), words_(words), clock_(machine, words.shot_s(machine)) {}

  /// Before the powder of a layer.
  void refill(const LayerCycle& cycle, ProgramBytes& out);
  /// Behind it: what is due every so many layers, and by the clock, which begins here.
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out);
  /// Before the head goes to a sweep: what would be overdue at its end. from, to  of the sweep, mm of the carriage, x and y.
  /// sweep_s  how long it takes; left out: its way at scan speed
  void before_sweep(CareClock::Place from, CareClock::Place to, ProgramBytes& out);
  void before_sweep(CareClock::Place from, CareClock::Place to, double sweep_s, ProgramBytes& out);
  /// Behind the last sweep.
  void dry(ProgramBytes& out) const;

 private:
  void serve(CareClock::Due due, ProgramBytes& out) const;
  void put_own(const std::vector<std::string>& lines, ProgramBytes& out) const;
  void go(std::string_view command, double x_mm, double y_mm, double speed_mm_s, ProgramBytes& out) const;

  const Machine& machine_;
  const CareWords& words_;
  CareClock clock_;
};

}  // namespace lamina::write
