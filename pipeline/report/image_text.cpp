#include "pipeline/report/image_text.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

double ml_of(std::uint64_t drops, double drop_pl) { return static_cast<double>(drops) * drop_pl * 1e-9; }

Json json_of(const checks::Spot& spot) {
  return {{"x_mm", spot.x_mm}, {"y_mm", spot.y_mm}, {"z_mm", spot.z_mm}, {"layer", spot.layer}};
}

Json json_of(const checks::Found& found, const std::string& amount) {
  Json json{{"count", found.count}};
  if (found.count == 0) return json;
  json[amount] = found.amount;
  json["largest_" + amount] = found.largest;
  json["largest_at"] = json_of(found.spot);
  for (const checks::Location& position : found.locations) {
    Json& one = json["locations"].emplace_back(json_of(position.spot));
    one["last_layer"] = position.last_layer;
    if (position.part != UINT32_MAX) one["part"] = position.part;
    one["box_mm"] = position.box_mm;
    one[amount] = position.amount;
  }
  return json;
}

}  // namespace

std::string powder_text(const PowderDrops& powder, double drop_pl) {
  const std::string count = readable_count(powder.pixels);
  if (drop_pl <= 0) return fmt::format("{} of {}", count, powder.name);
  return fmt::format("{} pixels of {}: {} drops, {:.3f} ml of binder", count, powder.name, readable_count(powder.drops),
                     ml_of(powder.drops, drop_pl));
}

Json powder_json(const PowderDrops& powder, double drop_pl) {
  Json fact = {{"name", powder.name}, {"set_pixels", powder.pixels}};
  if (drop_pl <= 0) return fact;
  fact["drops"] = powder.drops;
  fact["binder_mm3"] = 1000 * ml_of(powder.drops, drop_pl);
  return fact;
}

std::string binder_text(const dose::Budget& budget, const dose::BinderCount& count) {
  if (!budget.has_target()) {
    const auto [minimum, maximum] = budget.gets();
    const std::string share =
        minimum == maximum ? fmt::format("{:.1f}", maximum) : fmt::format("{:.1f} to {:.1f}", minimum, maximum);
    const double core = budget.jetting().core;
    const std::string thinned = core < 1 ? fmt::format(", of the core's {} %,", number_text(100 * core)) : "";
    const std::string pl = number_text(budget.binder().drop_pl);
    if (const std::uint32_t full = budget.jetting().full_drops; full > 1)
      return fmt::format("{} drops of {} pl a full voxel fill {} % of the voids", full, pl, share);
    return fmt::format("one drop of {} pl a pixel{} fills {} % of the voids", pl, thinned, share);
  }
  return fmt::format("{:.2f} % of the voids reached, {:.2f} % requested; {} drops, {:.3f} ml of binder, up to {} a pixel",
                     count.reached_percent(budget), count.requested_percent(budget), readable_count(count.drops()),
                     count.binder_ml(budget), count.max_drops() > 0 ? count.max_drops() : budget.max_drops());
}

Json binder_json(const dose::Budget& budget, const dose::BinderCount& count) {
  if (!budget.has_target())
    return {{"requested", false}, {"min_percent", budget.gets().first}, {"max_percent", budget.gets().second}};
  return {{"requested", true},
          {"requested_percent", count.requested_percent(budget)},
          {"reached_percent", count.reached_percent(budget)},
          {"drops", count.drops()},
          {"max_drops", budget.max_drops()},
          {"max_jetted_drops", count.max_drops()},
          {"binder_mm3", 1000 * count.binder_ml(budget)}};
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

std::string ranges_text(std::span<const checks::LayerRange> ranges) {
  constexpr std::size_t kMax = 6;
  const std::size_t shown = std::min(kMax, ranges.size());
  const bool one = ranges.size() == 1 && ranges[0][0] == ranges[0][1];
  std::string text = one ? "layer " : "layers ";
  for (std::size_t i = 0; i < shown; ++i) {
    if (i > 0) text += i + 1 == ranges.size() ? " and " : ", ";
    const auto [first, last] = ranges[i];
    text += first == last ? fmt::format("{}", first) : fmt::format("{} to {}", first, last);
  }
  if (shown < ranges.size()) text += fmt::format(" and {} more ranges", ranges.size() - shown);
  return text;
}

std::string refills_text(const std::vector<std::uint32_t>& refills) {
  constexpr std::size_t kReported = 6;
  if (refills.empty()) return {};
  std::string text = refills.size() == 1 ? "pauses before layer " : "pauses before layers ";
  for (std::size_t i = 0; i < std::min(kReported, refills.size()); ++i) {
    const bool last = i + 1 == refills.size();
    text += fmt::format("{}{}", i == 0 ? "" : last ? " and " : ", ", refills[i]);
  }
  if (refills.size() > kReported) text += fmt::format(" and {} more", refills.size() - kReported);
  return text + " for vats to be filled";
}

Json json_of(const checks::Findings& findings, double min_mm, double drain_mm) {
  Json json{{"layers", findings.layers},
            {"min_wall_mm", min_mm},
            {"min_drain_mm", drain_mm},
            {"islands", json_of(findings.islands, "mm2")},
            {"loose", json_of(findings.loose, "mm3")},
            {"hollows", json_of(findings.hollows, "mm3")},
            {"drains", json_of(findings.drains, "mm3")},
            {"thin", json_of(findings.thin, "mm2")},
            {"roofs", json_of(findings.roofs, "mm2")},
            {"gaps", json_of(findings.gaps, "mm2")},
            {"contacts", json_of(findings.contacts, "mm2")},
            {"touching", Json::array()}};
  for (const auto& pair : findings.touching) {
    json["touching"].push_back({{"part", pair.part}, {"other", pair.other}, {"at", json_of(pair.spot)}});
  }
  if (findings.bed_edge) json["bed_edge"] = json_of(*findings.bed_edge);
  if (findings.stop) json["stopped"] = {{"layer", findings.stop->layer}, {"bytes", findings.stop->bytes}};
  return json;
}

}  // namespace lamina::pipeline
