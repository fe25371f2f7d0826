#include "pipeline/check/toolpaths.h"

#include <fmt/format.h>

#include <utility>

#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"
#include "stages/formats/gcode/replay/defect_text.h"
#include "stages/formats/gcode/write_gcode.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using formats::gcode::Defect;
using formats::gcode::DefectCount;
using formats::gcode::kDefects;

/// "200 degC", or "205 to 210 degC".
std::string range_text(const std::array<double, 2>& range) {
  if (range[0] == range[1]) return fmt::format("{:g} degC", range[0]);
  return fmt::format("{:g} to {:g} degC", range[0], range[1]);
}

/// The machine of a recorded job, if it is known here; else none.
std::optional<ExtruderProfile> recorded_machine(const ManifestHead& head) {
  Job job;
  if (!read_job_text(head.job_toml, "manifest.json", job)) return std::nullopt;
  auto found = resolve_extruder(job);
  if (!found || found->machine.name != head.machine) return std::nullopt;
  return std::move(*found);
}

}  // namespace

Result<ToolpathCheck> check_toolpaths(const std::string& path, const ToolpathOptions& options, const ManifestHead* head,
                                      Faults& faults) {
  ToolpathCheck check;
  std::optional<ExtruderProfile> profile;
  if (!options.machine.empty()) {
    auto found = find_extruder(options.machine, options.material);
    if (!found) return found.error();
    profile = std::move(*found);
  } else if (head != nullptr) {
    profile = recorded_machine(*head);
  }
  if (profile) check.machine = profile->machine.name;
  auto replay = formats::gcode::replay_gcode(path, {profile ? &profile->machine : nullptr, options.filament_mm});
  if (!replay) return replay.error();
  check.replay = std::move(*replay);
  for (std::size_t k = 0; k < kDefects; ++k) {
    const auto kind = static_cast<Defect>(k);
    const DefectCount& of = check.replay.defects[kind];
    if (of.count == 0 || !is_fault(kind)) continue;
    if (kind == Defect::kUnreadable) {
      std::string text = check.replay.unreadable;
      if (text.starts_with(path + ": ")) text.erase(0, path.size() + 2);
      faults.add(std::move(text));
    } else {
      faults.add(defect_text(kind, of));
    }
  }
  if (!options.model.empty() && 4 * check.replay.totals.climbing > check.replay.totals.beads) {
    check.model.emplace();
    check.model->reason = "beads climb in a spiral, which has no layers";
  } else if (!options.model.empty()) {
    auto model = compare_with_model(path, options.model, options.filament_mm, faults);
    if (!model) return model.error();
    check.model = std::move(*model);
  }
  return check;
}

Summary::Lines ToolpathCheck::lines() const {
  const formats::gcode::ReplayTotals& t = replay.totals;
  Summary::Lines lines;
  const auto line = [&](const char* name, std::string text) { lines.emplace_back(name, std::move(text)); };
  line("layers", fmt::format("{}, {} beads, {:.2f} m; {} travels, {:.2f} m; {} retractions", readable_count(t.layers),
                             readable_count(t.beads), t.bead_mm / 1000, readable_count(t.travels), t.travel_mm / 1000,
                             readable_count(t.retractions)));
  line("filament",
       fmt::format("{:.1f} mm of {:g} mm, {:.2f} cm3, {:.2f} g", t.filament_mm, t.diameter_mm, t.mm3 / 1000, t.grams));
  const std::string stated =
      t.stated_seconds > 0 ? fmt::format("; the file states {}", formats::gcode::time_text(t.stated_seconds)) : "";
  line("printing", fmt::format("about {}{}", formats::gcode::time_text(t.seconds), stated));
  if (t.nozzle_degc[1] > 0) line("heat", fmt::format("nozzle {}, bed {}", range_text(t.nozzle_degc), range_text(t.bed_degc)));
  line("speed", fmt::format("beads up to {:.1f} mm/s, travels up to {:.1f} mm/s, up to {:.2f} mm3/s (line {})", t.max_bead_mm_s,
                            t.max_travel_mm_s, t.max_melt_mm3_s, t.max_melt_at.line));
  line("box", fmt::format("{:.3f} to {:.3f}, {:.3f} to {:.3f}, {:.3f} to {:.3f} mm", t.low[0], t.high[0], t.low[1], t.high[1],
                          t.low[2], t.high[2]));
  if (!machine.empty()) line("machine", machine);
  if (plan) {
    line("plan", plan->reason.empty() ? fmt::format("{} beads planned again; {} missing, {} not planned, {} changed",
                                                    readable_count(plan->planned), plan->missing, plan->added, plan->changed)
                                      : "not compared: " + plan->reason);
  }
  if (model && !model->reason.empty()) line("model", "not compared: " + model->reason);
  if (model && model->reason.empty()) {
    line("model",
         fmt::format("{} layers; {:.2f} cm3 of beads in {:.2f} cm3, {:.1f} % on average, {:.1f} % (layer {}) to {:.1f} % "
                     "(layer {}); outer walls along {:.0f} % of the outline or more (layer {})",
                     model->layers, model->bead_mm3 / 1000, model->model_mm3 / 1000, 100 * model->mean_fill(),
                     100 * model->min_fill.value, model->min_fill.layer, 100 * model->max_fill.value, model->max_fill.layer,
                     100 * model->min_outline.value, model->min_outline.layer));
  }
  for (std::size_t k = 0; k < kDefects; ++k) {
    const auto kind = static_cast<Defect>(k);
    const DefectCount& of = replay.defects[kind];
    if (of.count > 0 && !is_fault(kind)) line("note", defect_text(kind, of));
  }
  return lines;
}

Json ToolpathCheck::json() const {
  const formats::gcode::ReplayTotals& t = replay.totals;
  Json defects = Json::array();
  for (std::size_t k = 0; k < kDefects; ++k) {
    const auto kind = static_cast<Defect>(k);
    const DefectCount& of = replay.defects[kind];
    if (of.count == 0) continue;
    defects.push_back({{"kind", std::string(defect_name(kind))},
                       {"fault", is_fault(kind)},
                       {"count", of.count},
                       {"line", of.first.line},
                       {"layer", of.first.layer},
                       {"value", of.value},
                       {"limit", of.limit}});
  }
  Json json = {{"layers", t.layers},
               {"beads", t.beads},
               {"bead_mm", t.bead_mm},
               {"travels", t.travels},
               {"travel_mm", t.travel_mm},
               {"retractions", t.retractions},
               {"filament_mm", t.filament_mm},
               {"volume_mm3", t.mm3},
               {"filament_g", t.grams},
               {"seconds", t.seconds},
               {"stated_seconds", t.stated_seconds},
               {"max_bead_mm_s", t.max_bead_mm_s},
               {"max_travel_mm_s", t.max_travel_mm_s},
               {"max_melt_mm3_s", t.max_melt_mm3_s},
               {"nozzle_degc", Json::array()},
               {"bed_degc", Json::array()},
               {"low_mm", Json::array()},
               {"high_mm", Json::array()},
               {"defects", defects}};
  for (const double degc : t.nozzle_degc) json["nozzle_degc"].push_back(degc);
  for (const double degc : t.bed_degc) json["bed_degc"].push_back(degc);
  for (const double at : t.low) json["low_mm"].push_back(at);
  for (const double at : t.high) json["high_mm"].push_back(at);
  if (!machine.empty()) json["machine"] = machine;
  if (model) {
    json["model"] = {{"compared", model->reason.empty()},
                     {"reason", model->reason},
                     {"layers", model->layers},
                     {"model_mm3", model->model_mm3},
                     {"bead_mm3", model->bead_mm3},
                     {"mean_fill", model->mean_fill()},
                     {"min_fill", model->min_fill.value},
                     {"min_fill_layer", model->min_fill.layer},
                     {"max_fill", model->max_fill.value},
                     {"max_fill_layer", model->max_fill.layer},
                     {"min_outline", model->min_outline.value},
                     {"min_outline_layer", model->min_outline.layer}};
  }
  if (plan) {
    json["plan"] = {{"compared", plan->reason.empty()}, {"beads", plan->planned},
                    {"missing", plan->missing},         {"added", plan->added},
                    {"changed", plan->changed},         {"reason", plan->reason}};
  }
  return json;
}

}  // namespace lamina::pipeline
