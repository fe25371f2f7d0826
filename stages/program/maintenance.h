// stages/program/maintenance.h: maintenance of head and powder in programs: what is possible, when it is due, its lines.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/machine.h"
#include "stages/program/dialect.h"
#include "stages/program/program_text.h"

namespace lamina::program {

/// Of a limit in seconds: speeds are written in whole mm a minute, and firmware rounds as well.
inline constexpr double kShareOfLimit = 0.97;

/// From rest to rest at a speed as it is spelt. way_mm  at least 0
double move_seconds(const Machine& machine, double way_mm, double speed_mm_s);

/// A shot off the bed at the head's highest frequency.
double shot_seconds(const Machine& machine);

/// The clock of a layer, which begins with it, so that a layer's care depends on that layer alone.
class MaintenanceClock {
 public:
  /// What is due, in this order; a shot follows each wipe where the profile has shots, since a wiper leaves binder and grains
  /// at the nozzles.
  struct Due {
    bool wipe = false, shot = false;
  };

  /// machine outlives this object. shot_s  how long a shot takes
  MaintenanceClock(const Machine& machine, double shot_s) : machine_(machine), shot_s_(shot_s) {}

  /// Before the first sweep. at  where the head stands
  Due begin_layer(std::uint32_t layer, MachinePoint at);
  /// Before a sweep: what would be overdue at its end. The sweep is then made.
  /// ends     of the sweep, as it is run
  /// sweep_s  how long it takes without the way to it; default: its way at scan speed
  Due before_sweep(const std::array<MachinePoint, 2>& ends, std::optional<double> sweep_s = {});

 private:
  Due serve(bool wipe, bool shot);
  double seconds(MachinePoint from, MachinePoint to, double speed_mm_s) const;

  const Machine& machine_;
  double shot_s_;
  MachinePoint at_{};
  double since_shot_ = 0, since_wipe_ = 0;  // seconds
};

/// How a dialect spells it.
struct MaintenanceWords {
  std::string_view travel;                                  // the command of a movement off the bed
  void (*spit)(const Machine& machine, ProgramBytes& out);  // all nozzles that are not blocked, where the head stands
  std::string_view wait;                                    // a line behind movements, "" if none is needed
  std::string_view refill;                                  // the lines of a pause for the vats to be filled
  std::string_view dwell;                                   // "G4 P" ...
  double dwell_unit_s = 1;                                  // ... and what its number counts
  double (*shot_s)(const Machine& machine) = shot_seconds;  // how long `spit` takes
};

/// Writes the care of one layer after the other; a layer's lines depend on that layer alone.
class MaintenanceWriter {
 public:
  /// machine and words outlive this object
  MaintenanceWriter(const Machine& machine, const MaintenanceWords& words)
      : machine_(machine), words_(words), clock_(machine, words.shot_s(machine)) {}

  /// Before the powder of a layer.
  void refill(const LayerCycle& cycle, ProgramBytes& out);
  /// Behind it: what is due every so many layers, and by the clock, which begins here.
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) {
    serve(clock_.begin_layer(cycle.layer, machine_.motion.safe_mm), out);
  }
  /// Before the head goes to a sweep: see MaintenanceClock.
  void before_sweep(const std::array<MachinePoint, 2>& ends, ProgramBytes& out, std::optional<double> sweep_s = {}) {
    serve(clock_.before_sweep(ends, sweep_s), out);
  }
  /// Behind the last sweep.
  void dry(ProgramBytes& out) const;

 private:
  void serve(MaintenanceClock::Due due, ProgramBytes& out) const;
  void put_own(const std::vector<std::string>& lines, ProgramBytes& out) const;
  void travel(MachinePoint to, ProgramBytes& out) const;

  const Machine& machine_;
  const MaintenanceWords& words_;
  MaintenanceClock clock_;
};

/// Whether a dialect can express what a profile requests besides drops and powder, and a machine do it: positions off the bed,
/// limits in seconds that the longest sweep keeps. errors  kUsage, with the key and what to do
Status check_maintenance(const Dialect& dialect, const Machine& machine, const HeadGrid& grid);

/// Warns of what a profile has places for and never requests, and of head maintenance that does not go together: a lamp that
/// is switched on and never off, a pause without a cap that is longer than nozzles may wait.
void warn_of_idle_maintenance(const Machine& machine, std::vector<Warning>& warnings);

}  // namespace lamina::program
