#include "stages/geometry/interval_table.h"

namespace lamina {

IntervalTable<Nm> heights_of(std::span<const Box> boxes) {
  constexpr std::uint32_t kFinest = 14;  // 16 micrometres: below most layers, and few buckets for a tall part
  std::int64_t lowest = INT64_MAX, highest = INT64_MIN;
  for (const Box& box : boxes) {
    if (box.empty()) continue;
    lowest = std::min<std::int64_t>(lowest, box.lo.z);
    highest = std::max<std::int64_t>(highest, box.lo.z);
  }
  return {lowest, highest, kFinest, [&](auto use) {
            for (std::uint32_t i = 0; i < boxes.size(); ++i) {
              if (!boxes[i].empty()) use({boxes[i].lo.z, boxes[i].hi.z, i});
            }
          }};
}

}  // namespace lamina
