// stages/heights/per_part.h: layers of their own for each of several parts that are built together.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/heights/heights.h"

namespace lamina::heights {

/// Every part is built in slabs that are common to all; within a slab each part has its own layers, so that a part
/// with steep walls need not be built in the thin layers that its neighbour's slopes ask for.
/// source  J. Tyberg and J. H. Bohn, "Local adaptive slicing", Rapid Prototyping Journal 4 (1998)
struct PerPartPlan {
  std::int64_t slab = 0;    // nm: every part has a boundary at each multiple of it, up to the least thickness
                            // below its top
  std::vector<Plan> parts;  // by part; the table ends at the part's top
};

/// The height of the slabs: the greatest thickness, rounded up to a multiple of the least one, where the thicknesses
/// are a range; else the lowest height that both the least and the greatest thickness divide.
std::int64_t slab_height(const ThicknessSet& set);

/// Slabs of more than so many times the greatest thickness would leave the parts with hardly a boundary in common.
constexpr std::int64_t kMaxSlab = 16;

/// Whether slabs of these thicknesses are low enough. errors  kUsage
Status check_slab(const ThicknessSet& set);

/// The best table for every part (see optimal.h) of those that keep to the slabs.
/// index  used up
/// errors  of check_slab; as plan_heights
Result<PerPartPlan> plan_per_part(SurfaceIndex index, const Options& options);

}  // namespace lamina::heights
