#include "stages/formats/gcode/replay/bead_sections.h"

#include <algorithm>
#include <cmath>

namespace lamina::formats::gcode {

void BeadSections::bead(std::uint32_t type, double length_mm, double area_mm2, double tagged_mm2, FileLine at) {
  if (length_mm < kMinMm || !(tagged_mm2 > 0)) return;
  if (bins_.size() < (type + std::size_t{1}) * kBins) bins_.resize((type + std::size_t{1}) * kBins);
  const double ratio = area_mm2 / tagged_mm2;
  const double bin = (std::log2(ratio) + 6) * (kBins / 12.0);
  RatioBin& of = bins_[type * kBins + static_cast<std::size_t>(std::clamp(bin, 0.0, kBins - 1.0))];
  if (of.count++ == 0) of.ratio = ratio, of.first = at;
}

void BeadSections::finish(Defects& defects) const {
  constexpr std::size_t kNear = 2, kFar = 3;  // bins from the most frequent one: within 8 %, beyond 10 %
  for (std::size_t first = 0; first < bins_.size(); first += kBins) {
    const RatioBin* bins = bins_.data() + first;
    std::uint64_t all = 0, regular = 0;
    const std::size_t usual = static_cast<std::size_t>(
        std::max_element(bins, bins + kBins, [](const RatioBin& a, const RatioBin& b) { return a.count < b.count; }) - bins);
    const auto distance = [&](std::size_t k) { return k > usual ? k - usual : usual - k; };
    for (std::size_t k = 0; k < kBins; ++k) {
      all += bins[k].count;
      if (distance(k) <= kNear) regular += bins[k].count;
    }
    if (all < kEnough || static_cast<double>(regular) < kRegular * static_cast<double>(all)) continue;
    for (std::size_t k = 0; k < kBins; ++k) {
      if (distance(k) <= kFar || bins[k].count == 0) continue;
      const double ratio = bins[k].ratio / bins[usual].ratio;
      defects.add(k < usual ? Defect::kThinBead : Defect::kThickBead, bins[k].first, ratio, 1, bins[k].count);
    }
  }
}

}  // namespace lamina::formats::gcode
