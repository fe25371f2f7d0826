// stages/program/maintenance/maintenance.h: lines of G-code that keep nozzles from drying and vats from running empty.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <span>
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
  using MachinePoint = std::array<double, 2>;  // of the carriage, x and y in mm

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
  /// from, to  of the sweep. sweep_s  how long it takes without the way to it
  Due before_sweep(MachinePoint from, MachinePoint to, double sweep_s);
  Due before_sweep(MachinePoint from, MachinePoint to);

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
  std::string_view travel;                                  // the command of a movement beside the bed
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
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out);
  /// Before the head goes to a sweep: what would be overdue at its end. from, to  of the sweep, mm of the carriage, x and y.
  /// sweep_s  how long it takes; left out: its way at scan speed
  void before_sweep(MaintenanceClock::MachinePoint from, MaintenanceClock::MachinePoint to, ProgramBytes& out);
  void before_sweep(MaintenanceClock::MachinePoint from, MaintenanceClock::MachinePoint to, double sweep_s, ProgramBytes& out);
  /// Behind the last sweep.
  void dry(ProgramBytes& out) const;

 private:
  void serve(MaintenanceClock::Due due, ProgramBytes& out) const;
  void put_own(const std::vector<std::string>& lines, ProgramBytes& out) const;
  void go(std::string_view command, double x_mm, double y_mm, double speed_mm_s, ProgramBytes& out) const;

  const Machine& machine_;
  const MaintenanceWords& words_;
  MaintenanceClock clock_;
};

// --- care of head and powder in dialects of vectors alone, as records for their hosts.

/// What a record tells; the READMEs of raw and planes have the numbers that follow each.
enum class MaintenanceRecord : std::uint8_t { kGo, kFill, kBase, kRoller, kWipe, kShot, kDry, kOwn };

/// Writes the care of one layer after the other.
class MaintenanceRecords {
 public:
  using Put = void (*)(MaintenanceRecord kind, std::span<const std::uint32_t> numbers, ProgramBytes& out);

  /// machine and grid outlive this object. spell  how the dialect spells a record
  MaintenanceRecords(const Machine& machine, const HeadGrid& grid, Put spell)
      : machine_(machine), carriage_(machine, grid), clock_(machine, shot_seconds(machine)), put_(spell) {}

  /// Behind the record that begins a layer.
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out);
  void before_sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out);
  /// Behind the last sweep.
  void dry(ProgramBytes& out) const;

 private:
  void serve(MaintenanceClock::Due due, ProgramBytes& out) const;
  void put_own(const std::vector<std::string>& lines, ProgramBytes& out) const;
  void go(MaintenanceClock::MachinePoint to, ProgramBytes& out) const;
  void put(MaintenanceRecord kind, std::initializer_list<std::uint32_t> numbers, ProgramBytes& out) const {
    put_(kind, {numbers.begin(), numbers.size()}, out);
  }

  const Machine& machine_;
  Carriage carriage_;
  MaintenanceClock clock_;
  Put put_;
};

}  // namespace lamina::program
