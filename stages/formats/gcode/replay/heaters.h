// stages/formats/gcode/replay/heaters.h: the temperatures that a file commands, by tool.
#pragma once

#include <array>
#include <cstdint>

#include "stages/formats/gcode/read_gcode.h"
#include "stages/formats/gcode/words.h"

namespace lamina::formats::gcode {

/// Follows M104, M109, M140, M190 (Marlin, Klipper), G10 P S and M568 (RepRapFirmware), M302, and waits: M109, M116,
/// TEMPERATURE_WAIT.
class Heaters {
 public:
  /// Marlin's EXTRUDE_MINTEMP (Configuration.h) and Klipper's min_extrude_temp (klippy/extras/heaters.py) are 170 degC;
  /// RepRapFirmware's is 160 (src/Config/Configuration.h: HOT_ENOUGH_TO_EXTRUDE).
  static constexpr double kMinDegc = 170, kRepRapMinDegc = 160;

  void command(char letter, double code, const GcodeWords& words, std::uint8_t tool);
  /// A macro, which may heat; or TEMPERATURE_WAIT.
  void macro() { macro_ = true; }
  void wait() { waited_ = true; }
  /// Of the tool, or of the hottest one where no command named the tool: one nozzle for several filaments.
  double nozzle_degc(std::uint8_t tool) const;
  double bed_degc() const { return bed_; }
  /// A macro, or a printer that heats on its own, decides until a command does.
  bool unknown() const { return macro_ && !commanded_; }
  bool commanded() const { return commanded_; }
  bool waited() const { return waited_ || macro_; }
  /// The lowest temperature at which the firmware feeds.
  double min_degc(GcodeFile::Firmware firmware) const;

 private:
  std::array<double, GcodeFile::kTools> nozzle_{};
  std::uint32_t named_ = 0;  // a bit a tool
  double bed_ = 0, min_ = -1;
  bool macro_ = false, commanded_ = false, waited_ = false;
};

}  // namespace lamina::formats::gcode
