// stages/formats/gcode/replay/bead_sections.h: compares the volume of beads with their width and height.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "stages/formats/gcode/replay/defects.h"

namespace lamina::formats::gcode {

/// The ratio of a bead's cross-section to that of its ;WIDTH: and ;HEIGHT: tags, by type. A slicer has one ratio for nearly all beads of a
/// type: others are faults, as where a move is missing and the next one is too long for its filament. Types without such a rule are not
/// compared. Memory: kBins bins a type.
class BeadSections {
 public:
  static constexpr double kMinMm = 0.5;        // shorter beads differ by the decimals of X, Y and E
  static constexpr double kRegular = 0.98;     // of the beads of a type have one ratio
  static constexpr std::uint64_t kEnough = 40;  // beads of a type

  /// area_mm2  of the bead; tagged_mm2  of the tags
  void bead(std::uint32_t type, double length_mm, double area_mm2, double tagged_mm2, FileLine at);
  void finish(Defects& defects) const;

 private:
  struct RatioBin {
    std::uint64_t count = 0;
    double ratio = 0;  // of the first
    FileLine first;
  };
  static constexpr std::size_t kBins = 256;  // of 3.3 % each, from 1/64 to 64
  std::vector<RatioBin> bins_;
};

}  // namespace lamina::formats::gcode
