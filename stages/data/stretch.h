// stages/data/stretch.h: a piece of bead on its way from the filling to a file: never stored, only passed on.
#pragma once

#include <cstdint>

#include "stages/data/toolpaths.h"

namespace lamina {

enum class Thickness : std::uint8_t {
  kReference,  // as wide as walls and continuous lines
  kThick,      // wide enough to touch the neighbouring lines
  kThin        // leaves pores beside it
};

/// A straight piece of a layer's toolpaths, in the order in which they are laid.
struct Stretch {
  Point2 from, to;  // nm; never equal
  PathKind kind;
  Thickness thickness;
  Nm width;           // of the stored path: the reference width
  std::int32_t line;  // kNoLine if none
  bool jump;          // the nozzle travels to `from`, which is not where the stretch before ended
};

/// What a machine is told of a stretch.
struct BeadMove {
  Point2 from, to;  // nm
  PathKind kind;
  bool jump;
  Nm width;         // nm, that the bead is expected to have: a tag for viewers
  double area_mm2;  // cross-section of what is extruded: volume / length
  double speed_mm_s;
};

}  // namespace lamina
