#include "pipeline/report/dose_text.h"

#include <fmt/format.h>

#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

std::string binder_text(const dose::Budget& budget, const dose::BinderCount& count) {
  if (!budget.has_wish()) {
    const auto [least, most] = budget.gets();
    const std::string share = least == most ? fmt::format("{:.1f}", most) : fmt::format("{:.1f} to {:.1f}", least, most);
    const double core = budget.jetting().core;
    const std::string thinned = core < 1 ? fmt::format(", of the core's {} %,", number_text(100 * core)) : "";
    const std::string pl = number_text(budget.binder().drop_pl);
    if (const std::uint32_t full = budget.jetting().full_drops; full > 1)
      return fmt::format("{} drops of {} pl a full voxel fill {} % of the voids", full, pl, share);
    return fmt::format("one drop of {} pl a pixel{} fills {} % of the voids", pl, thinned, share);
  }
  return fmt::format("{:.2f} % of the voids reached, {:.2f} % asked; {} drops, {:.3f} ml of binder, up to {} a pixel",
                     count.reached_percent(budget), count.asked_percent(budget), readable_count(count.drops()),
                     count.binder_ml(budget), count.most_drops() > 0 ? count.most_drops() : budget.most_drops());
}

Json binder_json(const dose::Budget& budget, const dose::BinderCount& count) {
  if (!budget.has_wish())
    return {{"asked", false}, {"least_percent", budget.gets().first}, {"most_percent", budget.gets().second}};
  return {{"asked", true},
          {"asked_percent", count.asked_percent(budget)},
          {"reached_percent", count.reached_percent(budget)},
          {"drops", count.drops()},
          {"most_drops", budget.most_drops()},
          {"most_jetted_drops", count.most_drops()},
          {"binder_ml", count.binder_ml(budget)}};
}

std::string voxels_text(const dose::ShareCount& count, std::uint32_t levels, std::string_view as) {
  return fmt::format(
      "{} levels come to {} full voxels, as {}; {} ({:.3f} %) half full or more are not as their centre, {} away "
      "from any boundary",
      levels, readable_count(count.full_voxels), as, readable_count(count.half_differs), 100 * count.differing_share(),
      readable_count(count.half_far));
}

Json voxels_json(const dose::ShareCount& count, std::uint32_t levels, std::string_view as) {
  return {{"levels", levels},
          {"as", as},
          {"full_voxels", count.full_voxels},
          {"half_differs", count.half_differs},
          {"half_differs_share", count.differing_share()},
          {"half_far", count.half_far}};
}

}  // namespace lamina::pipeline
