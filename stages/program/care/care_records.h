// stages/program/care/care_records.h: care of head and powder in dialects of vectors alone, as records for their hosts.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "stages/program/care/care_clock.h"
#include "stages/program/dialect.h"
#include "stages/program/program_text.h"

namespace lamina::write {

/// What a record tells; the READMEs of raw and planes have the numbers that follow each.
enum class CareRecord : std::uint8_t { kGo, kFill, kBase, kRoller, kWipe, kShot, kDry, kOwn };

/// Writes the care of one layer after the other.
class CareRecords {
 public:
  using Put = void (*)(CareRecord kind, std::span<const std::uint32_t> numbers, ProgramBytes& out);

  /// machine and grid outlive this object. spell  how the dialect spells a record
  CareRecords(const Machine& machine, const HeadGrid& grid, Put spell)
      : machine_(machine), carriage_(machine, grid), clock_(machine, shot_seconds(machine)), put_(spell) {}

  /// Behind the record that begins a layer.
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out);
  void before_sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out);
  /// Behind the last sweep.
  void dry(ProgramBytes& out) const;

 private:
  void serve(CareClock::Due due, ProgramBytes& out) const;
  void put_own(const std::vector<std::string>& lines, ProgramBytes& out) const;
  void go(CareClock::Place to, ProgramBytes& out) const;
  void put(CareRecord kind, std::initializer_list<std::uint32_t> numbers, ProgramBytes& out) const {
    put_(kind, {numbers.begin(), numbers.size()}, out);
  }

  const Machine& machine_;
  Carriage carriage_;
  CareClock clock_;
  Put put_;
};

}  // namespace lamina::write
