#include "pipeline/plan/dose.h"

#include <algorithm>
#include <cmath>

#include "stages/dose/saturate.h"

namespace lamina::pipeline {

DosePlan::DosePlan(const Job& job, const PixelGrid& grid)
    : bleed_(dose::reach_of(grid, std::llround(job.dose.bleed_um[0] * 1000), std::llround(job.dose.bleed_um[1] * 1000))),
      core_(job.dose.core) {
  const std::int64_t shell = nm_of(job.dose.shell_mm);
  if (core_ < 1) shell_ = dose::reach_of(grid, shell, shell);
}

void DosePlan::remove_bleed(Runs& image, Runs& second) const {
  if (!bleeds()) return;
  dose::erode(image, bleed_, second);
  std::swap(image, second);
}

void DosePlan::thin(std::uint32_t layer, Runs& image, Runs& second, Runs& third) const {
  if (core_ >= 1) return;
  if (!shell_.half_width.empty()) dose::erode(image, shell_, third);
  dose::saturate(image, shell_.half_width.empty() ? image.view() : third.view(), core_, layer, second);
  std::swap(image, second);
}

std::uint64_t DosePlan::changes_bound(std::uint64_t changes, std::uint64_t covered) const {
  if (core_ >= 1) return changes;
  return changes + static_cast<std::uint64_t>(2 * std::min(core_, 1 - core_) * static_cast<double>(covered)) + 2;
}

}  // namespace lamina::pipeline
