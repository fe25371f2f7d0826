#include "stages/raster/porous.h"

#include <algorithm>
#include <utility>

#include "stages/raster/combine.h"

namespace lamina::raster {

Nm BeadWidths::of(const Stretch& s) const {
  if (s.thickness == Thickness::kThick) return thick;
  if (s.thickness == Thickness::kThin) return thin;
  const bool wall = s.kind == PathKind::kOuter || s.kind == PathKind::kInner;
  return segmented && !wall ? continuous : s.width;
}

void BeadPen::lay(const Stretch& s) {
  const Nm width = widths_.of(s);
  beads_.add(s.from, s.to, width, ends_);
  // Square ends leave a wedge where a bead turns; they belong only where its width changes along a line.
  const bool turns = !s.jump && (s.thickness == last_ || s.kind != last_kind_);
  if (ends_ == BeadEnds::kSquare && turns) beads_.add(s.from, s.from, std::min(width, last_width_), BeadEnds::kRound);
  last_width_ = width;
  last_ = s.thickness;
  last_kind_ = s.kind;
}

void keep_beads(Runs& image, Runs& laid, Runs* inner, Runs& scratch) {
  combine(image, laid, SetOperation::kIntersection, scratch);
  if (inner != nullptr) {
    combine(image, *inner, SetOperation::kDifference, laid);
    combine(scratch, laid, SetOperation::kUnion, *inner);
    std::swap(scratch, *inner);
  }
  std::swap(image, scratch);
}

}  // namespace lamina::raster
