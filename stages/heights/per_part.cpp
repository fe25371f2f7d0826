#include "stages/heights/per_part.h"

#include <fmt/format.h>

#include <numeric>
#include <utility>

namespace lamina::heights {

std::int64_t slab_height(const ThicknessSet& set) {
  const std::int64_t minimum = set.minimum(), maximum = set.maximum();
  return set.is_contiguous() ? ceil_div(maximum, minimum) * minimum : std::lcm(minimum, maximum);
}

Status check_slab(const ThicknessSet& set) {
  const std::int64_t slab = slab_height(set);
  if (slab <= kMaxSlab * set.maximum()) return {};
  return Error{Fault::kUsage,
               fmt::format("heights.per_part: {} and {} mm meet only every {} mm; give thicknesses with a smaller "
                           "common multiple, or a range",
                           mm(set.minimum()), mm(set.maximum()), mm(slab))};
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
