// stages/program/hp45/hp45.h: lines for the HP45 controller V4, as its hosts send them; see the README here.
#pragma once

#include <string_view>

#include "stages/program/dialect.h"
#include "stages/program/maintenance.h"
#include "stages/program/program_text.h"

namespace lamina::program::hp45 {

/// Spells what the controller needs; the motion between is G-code.
class Head {
 public:
  Head(const Machine& machine, const HeadGrid& grid);

  /// Mode of position, encoder, resolution, density, sides and buffer: all that a layer needs, so that it can be sent alone.
  void settings(ProgramBytes& out) const;
  /// Moves to the start, waits, sends the lines and moves over them; before that any head maintenance that is due.
  void sweep(const Sweep& sweep, const SweepVectors& vectors, MaintenanceWriter& maintenance, ProgramBytes& out) const;
  /// The host continues when all movements have ended.
  static constexpr std::string_view kWait = "G4 P0\n";
  static void wait(ProgramBytes& out) { put(out, "{}", kWait); }
  /// All nozzles of the cartridge fire where the head stands, by the firmware's DMAPrint::Prime; the host waits until they
  /// have.
  static void spit(const Machine& machine, ProgramBytes& out);

 private:
  void line(double encoder_um, const std::uint64_t* words, std::uint32_t count, ProgramBytes& out) const;

  const Machine& machine_;
  const HeadGrid& grid_;
  Carriage carriage_;
  std::uint32_t counts_;  // of the encoder, an inch
  std::uint32_t repeat_;  // nozzles of the cartridge a nozzle of the profile
};

}  // namespace lamina::program::hp45
