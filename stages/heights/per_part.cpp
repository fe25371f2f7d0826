#include "stages/heights/per_part.h"

#include <fmt/format.h>

#include <numeric>
#include <utility>

namespace lamina::heights {

std::int64_t slab_height(const ThicknessSet& set) {
  const std::int64_t least = set.least(), most = set.most();
  return set.is_contiguous() ? ceil_div(most, least) * least : std::lcm(least, most);
}

Status check_slab(const ThicknessSet& set) {
  const std::int64_t slab = slab_height(set);
  if (slab <= kMostSlab * set.most()) return {};
  return Error{Fault::kUsage,
               fmt::format("heights.per_part: {} and {} mm meet only every {} mm; give thicknesses with a smaller "
                           "common multiple, or a range",
                           mm(set.least()), mm(set.most()), mm(slab))};
}

Result<PerPartPlan> plan_per_part(SurfaceIndex index, const Options& options) {
  if (Status status = check_slab(options.set); !status) return status.error();
  PerPartPlan result;
  result.slab = slab_height(options.set);
  Options own = options;
  own.mode = Mode::kOptimal;
  own.slab = result.slab;
  const std::vector<PartSurface> parts = std::exchange(index.parts, {});
  for (const PartSurface& part : parts) {
    index.parts = {part};
    index.top = part.top;
    Result<Plan> plan = plan_heights(index, own);
    if (!plan) return plan.error();
    result.parts.push_back(std::move(*plan));
  }
  return result;
}

}  // namespace lamina::heights
