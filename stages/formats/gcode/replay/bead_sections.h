// stages/formats/gcode/replay/bead_sections.h: compares the volume of beads with their width and height.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/formats/gcode/replay/defects.h"

namespace lamina::formats::gcode {

/// The ratio of a bead's cross-section to that of its ;WIDTH: and ;HEIGHT: tags, by type. Beads that differ from the one before
/// and the one after, which agree with each other, are faults, as where a move is missing and the next one is too long for its
/// filament. Where a type has many of them they are how its file is made, as thick and thin segments are, and no faults.
class BeadSections {
 public:
  static constexpr double kMinMm = 0.5;     // shorter beads differ by the decimals of X, Y and E
  static constexpr double kSame = 0.04;     // of the ratio, between beads that agree
  static constexpr double kOther = 0.1;     // of the ratio, of one that differs
  static constexpr double kLackMm = 0.2;    // of its length: more than the gap of a seam, which is deposited with the next bead
  static constexpr double kRare = 0.01;     // of the beads of a type
  static constexpr std::uint64_t kFew = 3;  // of a type with few beads

  /// area_mm2  of the bead; tagged_mm2  of the tags
  void bead(std::uint32_t type, double length_mm, double area_mm2, double tagged_mm2, FileLine at);
  void finish(Defects& defects) const;

 private:
  struct TypeRatios {
    double last = 0, before = 0;  // of the last two beads; 0: fewer
    double last_mm = 0;
    FileLine last_at;
    std::uint64_t beads = 0, thin = 0, thick = 0;
    FileLine first_thin, first_thick;
    double thin_ratio = 0, thick_ratio = 0;  // of the first ones
  };
  std::vector<TypeRatios> types_;
};

}  // namespace lamina::formats::gcode
