// stages/formats/gcode/arc.h: the way of an arc of G-code (G2, G3) in the plane of the bed, as chords.
#pragma once

#include <cstdint>
#include <optional>

namespace lamina::read {

/// The words of a G2 or G3, in mm. I and J lead from the start to the centre, whatever G90 and G91 say; R excludes them.
struct ArcWords {
  bool clockwise = false;  // G2
  double i = 0, j = 0;
  std::optional<double> radius;  // R; negative: the longer way round
};

/// A circular way between two points as firmwares run it: plan_arc() and G2_G3() of Marlin (MarlinFirmware/Marlin @000f5c7,
/// Marlin/src/gcode/motion/G2_G3.cpp), from which Klipper's planArc() (Klipper3d/klipper @84104bb,
/// klippy/extras/gcode_arcs.py) is taken. Both run chords of about 1 mm; these deviate by kTolerance at most.
///
/// - The end at the start: a full circle.
/// - An end off the circle: the radius of the start holds, and the last chord leads to the end.
/// - |R| shorter than half of the way: half a circle around the middle.
///
/// units  mm
class Arc {
 public:
  static constexpr double kTolerance = 0.005;
  struct Place {
    double x = 0, y = 0;
  };

  /// False where Marlin prints an error and stays where it is (Klipper and RepRapFirmware end the print): neither R nor I and
  /// J; R with an end at the start; or, without a word of Marlin, an end in the direction of the start, counter-clockwise.
  /// Also of radii beyond all numbers of a firmware.
  bool plan(Place from, Place to, const ArcWords& words);
  /// At least 1. The chords within a bed of some metres are a few thousand, whatever the radius.
  std::uint64_t chords() const { return chords_; }
  /// The end of a chord, 1 .. chords(); that of the last one is the arc's.
  Place end_of(std::uint64_t chord) const;
  double miss() const { return miss_; }                // of the end, off the circle
  bool radius_short() const { return short_radius_; }  // R is more than 1 % too short, which RepRapFirmware refuses

 private:
  Place from_, to_, spoke_;  // spoke: from the centre to the start
  double travel_ = 0;        // radians, counter-clockwise
  double miss_ = 0;
  bool short_radius_ = false;
  std::uint64_t chords_ = 1;
};

}  // namespace lamina::read
