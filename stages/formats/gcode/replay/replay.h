// stages/formats/gcode/replay/replay.h: runs a G-code file as a printer would and reports what damages a print.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "stages/data/extruder.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/status.h"
#include "stages/formats/gcode/replay/defects.h"

namespace lamina {
class FileReader;
}

namespace lamina::formats::gcode {

struct ReplayOptions {
  const Extruder* machine = nullptr;  // null: no rule that needs one
  double filament_mm = 0;             // diameter; 0: the file's, the machine's or 1.75
};

/// Sums over the layers; start code is not in them, where tags show where it ends.
struct ReplayTotals {
  std::uint32_t layers = 0;
  std::uint64_t beads = 0, climbing = 0, travels = 0, retractions = 0, lines = 0;
  double bead_mm = 0, travel_mm = 0;           // climbing: beads, of spirals
  double filament_mm = 0, mm3 = 0, grams = 0;  // net, of beads; filament_mm of the diameter below
  double diameter_mm = 1.75;
  double seconds = 0;                             // by acceleration and corner speed (print_time.h)
  double max_bead_mm_s = 0, max_travel_mm_s = 0;  // commanded
  double max_melt_mm3_s = 0;                      // of beads of 1 mm or more
  FileLine max_melt_at;
  std::array<double, 2> nozzle_degc{}, bed_degc{};    // lowest and highest, of beads; 0: not commanded
  std::array<double, 3> low{}, high{};                // mm, of the ends of beads
  double stated_seconds = 0, stated_filament_mm = 0;  // by comments of the file; 0: none
  bool own = false;                                   // lamina wrote it
  std::string machine;                                // that it names
};

struct ReplayReport {
  Defects defects;
  ReplayTotals totals;
  std::string unreadable;  // why the replay ended early, with the line; else empty
};

/// Replays a file by the rules of Marlin, Klipper and RepRapFirmware in one pass.
///
/// errors  kUsage: cannot be read, is no text of G-code, has no bead
/// cost    O(bytes); memory of the largest layer, 32 bytes a bead
Result<ReplayReport> replay_gcode(const std::string& path, const ReplayOptions& options);

}  // namespace lamina::formats::gcode
