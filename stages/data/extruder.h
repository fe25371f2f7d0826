// stages/data/extruder.h: a material extrusion printer as its profile describes it, and what was measured on it. Plain values,
// units in the names.
#pragma once

#include <array>
#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace lamina {

/// The cross-section of a bead of a width and height. A stadium is a rectangle with half circles at both sides, what
/// PrusaSlicer and Slic3r take (their `Flow`). An ellipse has the same width and height and is narrower at the bottom.
enum class BeadShape : std::uint8_t { kStadium, kRectangle, kEllipse };

/// Everything that a profile says; what a job may change is changed here before anything is planned.
struct Extruder {
  std::string name, description;
  std::string format = "gcode";                  // "gcode" or "sml"
  double max_nozzle_degc = 0, max_bed_degc = 0;  // that the heaters reach; 0: not stated

  struct ExtruderBed {
    std::array<double, 2> size_mm{220, 220};
    double build_height_mm = 250;
    double margin_mm = 0;                   // along its sides, where nothing is arranged
    std::array<double, 2> corner_mm{0, 0};  // machine coordinates of its front left corner
  } bed;

  struct Material {
    double nozzle_mm = 0.4;
    double filament_mm = 1.75;
    double density_g_cm3 = 1.24;
    // 100 % extrudes bead_area x flow: the shape of the bead, all of it in the volume. Absent: a stadium.
    std::optional<BeadShape> bead_area;
    double flow = 1;        // found by measuring walls
    double feed_ratio = 1;  // the machine's error: filament that is fed / filament commanded by E
    double lag_s = 0;       // with which the melt follows its feed (stages/bead/line.h); 0: at once, or unknown
    double nozzle_degc = 200, bed_degc = 60;
    double first_nozzle_degc = 200, first_bed_degc = 60;  // while the first layer is extruded
    std::string name;                                     // as "PETG"; empty: not stated
    double price_kg = 0;                                  // in currency; 0: not stated
    std::string currency = "EUR";                         // of price_kg
    double max_melt_mm3_s = 0;                            // melted per second at most, which limits speeds; 0: not stated

    BeadShape shape() const { return bead_area.value_or(BeadShape::kStadium); }
    /// Volume extruded per millimetre of E, mm3.
    double mm3_of_e() const { return feed_ratio * std::numbers::pi / 4 * filament_mm * filament_mm; }
  } material;

  struct Speed {
    double print_mm_s = 40;  // raster and closed curves that fill: the reference of segmented lines
    double wall_mm_s = 30, inner_wall_mm_s = 40;
    double first_layer_mm_s = 15;  // speed limit of the first layer; thin segments exceed it by their share
    double travel_mm_s = 120, lift_mm_s = 10;
    double acceleration_mm_s2 = 1000;  // of the head: deposited widths and times depend on it
    bool states_acceleration = false;  // the profile has it: G-code commands it
    double corner_mm_s = 8;            // change of speed that the machine makes at once
  } speed;

  struct Retraction {
    double length_mm = 1, speed_mm_s = 35;
    double min_travel_mm = 1.5;  // shorter travels are made without it
    bool inside = false;         // travels that stay inside the contours of the layer are made without it
    double detour_mm = 0;        // by which such a travel may be longer than its line; 0: lines only
    double wipe_mm = 0;          // back along the bead while the filament is drawn back
    double lift_mm = 0;          // of the nozzle, while it is drawn back
  } retraction;

  /// Beads before the first one of the part: the nozzle has oozed while it was heated and the axes were homed.
  struct Skirt {
    std::uint32_t loops = 1;  // around all parts; 0: none
    double distance_mm = 5;   // from the parts' box to the nearest loop
    double min_mm = 100;      // loops are added until they are so long in all
  } skirt;

  struct Fan {
    double percent = 100;
    std::uint32_t from_layer = 1;  // counted from 0
    std::uint32_t full_layer = 0;  // up to which the fan speeds up; at most from_layer: at once
    double min_layer_s = 0;        // layers that take less have slower beads
    double min_print_mm_s = 10;    // that these beads have at least
  } fan;

  struct Code {
    std::string flavor = "Marlin";  // reported to viewers: Marlin, RepRap (RepRapFirmware), Repetier or Klipper
    bool relative_extrusion = true;
    // In start, end and layer: {nozzle_degc} {bed_degc} {first_nozzle_degc} {first_bed_degc} {layer} {z} {layers}
    std::string start, end, layer;
    bool progress = false;                            // M73 at every layer
    std::string objects = "none";                     // tags of parts, which the firmware can skip: "m486" or "klipper"
    std::array<std::uint32_t, 2> thumbnail_px{0, 0};  // picture of the parts at the start; 0: none
    std::string plain_pressure;  // switches pressure advance off: what segmented lines need, they live from its delay
  } code;

  struct Sml {
    /// One line of the machine's table: the PD command for layers of a thickness.
    struct Pd {
      double thickness_mm;
      std::string use;  // "raster", "contour" or "support"
      std::string line;
    };
    std::vector<Pd> pd;
    std::string header, footer, height = "PZ{z};", travel = "PU{x},{y};", draw = "PA{x},{y};";  // 1/1000 inch
  } sml;
};

/// What a printer makes of speed and extrusion: measured tables. Percentages are relative to the reference: 100 % extrusion
/// gives the set width at the set height, 100 % speed is that of walls and continuous lines.
struct Calibration {
  std::string source;                                       // of the numbers, for people
  double width_mm = 0.4, height_mm = 0.3, speed_mm_s = 15;  // what 100 % means

  /// A thin stretch between long thick ones, by its speed; extrusion 100 %.
  struct BySpeed {
    double percent, thin_mm;
    double stable_mm;  // after this distance the bead is as wide as before: a longer thin stretch closes its pore
    double swell_mm;   // width of the thick stretch that follows, at its widest
  };
  std::vector<BySpeed> by_speed;  // percent increasing, above 100

  /// A thin stretch by its extrusion; speed 100 %.
  struct ByExtrusion {
    double percent, thin_mm;
  };
  std::vector<ByExtrusion> by_extrusion;  // percent decreasing, below 100

  /// Short thick and thin stretches in turn: the thick speed that keeps widths the same along the part, and the widths.
  struct Repeated {
    double extrusion_percent, thin_speed_percent, thick_speed_percent;
    double thick_mm, thin_mm, continuous_mm;
  };
  std::vector<Repeated> repeated;  // extrusion increasing

  /// Spacings that were settled on for an extrusion, centre to centre; where there are none they follow from the widths.
  struct Spaced {
    double extrusion_percent, segmented_mm, continuous_mm;
  };
  std::vector<Spaced> spacing;  // extrusion increasing
};

/// A printer and what was measured on it.
struct ExtruderProfile {
  Extruder machine;
  Calibration calibration;
  bool own_calibration = false;        // the profile has one
  bool predicted_calibration = false;  // by the model of a bead, from the machine's lag
};

}  // namespace lamina
