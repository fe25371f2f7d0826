#include "stages/formats/gcode/replay/bead_sections.h"

#include <algorithm>
#include <cmath>

namespace lamina::formats::gcode {

void BeadSections::bead(std::uint32_t type, double length_mm, double area_mm2, double tagged_mm2, FileLine at) {
  if (length_mm < kMinMm || !(tagged_mm2 > 0)) return;
  if (types_.size() <= type) types_.resize(type + std::size_t{1});
  TypeRatios& of = types_[type];
  const double ratio = area_mm2 / tagged_mm2;
  ++of.beads;
  if (of.before > 0 && std::abs(ratio - of.before) <= kSame * of.before) {
    const double other = of.last / of.before;
    const bool lacks = std::abs(1 - other) * of.last_mm >= kLackMm;
    if (lacks && other < 1 - kOther) {
      if (of.thin++ == 0) of.first_thin = of.last_at, of.thin_ratio = other;
    } else if (lacks && other > 1 + kOther) {
      if (of.thick++ == 0) of.first_thick = of.last_at, of.thick_ratio = other;
    }
  }
  of.before = of.last;
  of.last = ratio;
  of.last_mm = length_mm;
  of.last_at = at;
}

void BeadSections::finish(Defects& defects) const {
  for (const TypeRatios& of : types_) {
    const auto rare = std::max(kFew, static_cast<std::uint64_t>(kRare * static_cast<double>(of.beads)));
    if (of.thin + of.thick > rare) continue;
    if (of.thin > 0) defects.add(Defect::kThinBead, of.first_thin, of.thin_ratio, 1, of.thin);
    if (of.thick > 0) defects.add(Defect::kThickBead, of.first_thick, of.thick_ratio, 1, of.thick);
  }
}

}  // namespace lamina::formats::gcode
