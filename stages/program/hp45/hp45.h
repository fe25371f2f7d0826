// stages/program/hp45/hp45.h: see the README here.
#pragma once

#include <string_view>

#include "stages/program/dialect.h"
#include "stages/program/maintenance/maintenance.h"
#include "stages/program/program_text.h"

namespace lamina::program::hp45 {

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid);

// --- lines for the HP45 controller V4, as its hosts send them; see the README here.

/// Whether the controller can jet the machine's images.
/// errors  kUsage: rows of its own, lags in ticks, more steps than its buffer holds, an encoder too coarse for its pixels,
///         nozzles without a channel of their own, a scan speed that it cannot tell
Status check(const Machine& machine, const HeadGrid& grid);

/// Spells what the controller needs; the motion between is G-code.
class Head {
 public:
  Head(const Machine& machine, const HeadGrid& grid);

  /// Mode of position, encoder, resolution, density, sides and buffer: whatever a layer needs, so that it can be sent alone.
  void settings(ProgramBytes& out) const;
  /// Moves to the start, waits, sends the lines and moves over them; before that whatever care is due.
  void sweep(const Sweep& sweep, const SweepVectors& vectors, MaintenanceWriter& maintenance, ProgramBytes& out) const;
  /// The host goes on when all movements have ended.
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
