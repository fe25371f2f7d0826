// stages/data/jetting.h: where a print head passes and stands over the pixels of a layer.
#pragma once

namespace lamina {

/// What a sweep of the head passes over: pixels [left, right) x [top, bottom) of the image.
struct SwathBand {
  double left, right, top, bottom;
  bool present;  // the one under inspection
};

/// A nozzle at a step.
struct NozzlePosition {
  double column, row;  // of its centre, in pixels
  bool fires;
};

}  // namespace lamina
