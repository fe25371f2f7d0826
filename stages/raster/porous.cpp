#include "stages/raster/porous.h"

#include <algorithm>
#include <utility>

#include "stages/geometry/combine.h"

namespace lamina::raster {

Nm BeadWidths::of(const PathInterval& s) const {
  if (s.thickness == Thickness::kThick) return thick;
  if (s.thickness == Thickness::kThin) return thin;
  const bool wall = s.kind == PathKind::kOuter || s.kind == PathKind::kInner;
  return segmented && !wall ? continuous : s.width;
}

void BeadPen::deposit(const PathInterval& s) {
  const Nm width = widths_.of(s);
  beads_.add(s.from, s.to, width, ends_);
  // Square ends leave a wedge where a bead turns; they belong only where its width changes along a line.
  const bool turns = !s.jump && (s.thickness == last_ || s.kind != last_kind_);
  if (ends_ == BeadEnds::kSquare && turns) beads_.add(s.from, s.from, std::min(width, last_width_), BeadEnds::kRound);
  last_width_ = width;
  last_ = s.thickness;
  last_kind_ = s.kind;
}

void keep_beads(Runs& image, BeadRaster& beads, const Runs* inner, Runs& scratch) {
  scratch.columns = image.columns;
  scratch.row_offset.assign(1, 0);
  scratch.change.clear();
  Runs kept, shell;  // of a band
  beads.for_each_band([&](std::uint32_t first, const RunsView& deposited) {
    const auto band_of = [&](const Runs& whole) {
      return RunsView{whole.columns, std::span(whole.row_offset).subspan(first, std::size_t{deposited.rows()} + 1),
                      whole.change};
    };
    const RunsView part = band_of(image);
    if (inner == nullptr) return append_combined(part, deposited, SetOperation::kIntersection, scratch);
    combine(part, deposited, SetOperation::kIntersection, kept);
    combine(part, band_of(*inner), SetOperation::kDifference, shell);
    append_combined(kept, shell, SetOperation::kUnion, scratch);
  });
  std::swap(image, scratch);
}

}  // namespace lamina::raster
