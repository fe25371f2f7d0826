#include "pipeline/pores/design_page.h"

#include <fmt/format.h>

#include "stages/segment/permeability.h"  // the unit
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {
namespace {

constexpr std::string_view kSure =
    "sure      +- is of the voxels; prints of this kind by an Anet A8 have lain within a factor of 1.5 of measured k1,\n"
    "          2.5 points of measured porosity (bench/pores.md)\n";

std::string lines_text(const segment::SegmentSettings& keys) {
  return fmt::format("thick {:g} mm, thin {:g} mm, {} continuous line{} between segmented ones, S-C {:g}, C-C {:g} mm",
                     keys.thick_mm, keys.thin_mm, keys.continuous, keys.continuous == 1 ? "" : "s", *keys.spacing_sc_mm,
                     *keys.spacing_cc_mm);
}

Json segment_json(const segment::SegmentSettings& keys) {
  return {{"thick_mm", keys.thick_mm},
          {"thin_mm", keys.thin_mm},
          {"continuous_lines", keys.continuous},
          {"spacing_sc_mm", *keys.spacing_sc_mm},
          {"spacing_cc_mm", *keys.spacing_cc_mm},
          {"thick_extrusion_percent", keys.thick_extrusion},
          {"thick_speed_percent", *keys.thick_speed},
          {"thin_speed_percent", keys.thin_speed}};
}

/// What is wished for, as options.
std::string target_text(const segment::PoreTarget& target) {
  std::string text;
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : " ") + part; };
  if (target.porosity) add(fmt::format("--porosity {:.4g}", 100 * *target.porosity));
  if (target.permeability_m2) add(fmt::format("--permeability {:.4g}", *target.permeability_m2 / segment::kDarcy));
  if (target.pore_width_mm) add(fmt::format("--pore {:.3g}x{:.3g}", *target.pore_width_mm, *target.pore_length_mm));
  return text;
}

Json target_json(const segment::PoreTarget& target) {
  Json json = Json::object();
  if (target.porosity) json["porosity"] = *target.porosity;
  if (target.permeability_m2) json["k1_darcy"] = *target.permeability_m2 / segment::kDarcy;
  if (target.pore_width_mm) json["pore_mm"] = {*target.pore_width_mm, *target.pore_length_mm};
  return json;
}

/// The filling and what its forward run says, into an object.
void report_plan(const DesignedJob& found, Json& json) {
  const ForwardRun& forward = found.forward;
  json["segment"] = segment_json(found.design.settings);
  json["porosity"] = forward.porosity;
  json["porosity_through"] = forward.porosity_through;
  json["k1_darcy"] = forward.permeability_m2 / segment::kDarcy;
  json["k1_error_darcy"] = forward.permeability_error_m2 / segment::kDarcy;
  json["k1_m2"] = forward.permeability_m2;
  json["resolved"] = forward.resolved;
  json["throat_mm"] = found.design.slots.throat_mm;
  json["pore_mm"] = {forward.pore_width_mm, forward.pore_length_mm};
}

Json step_json(const GradientStep& one) {
  Json json{{"from_mm", one.step.from_mm},
            {"to_mm", one.step.to_mm},
            {"target", target_json(one.step.target)},
            {"met", one.found.met},
            {"miss", one.found.miss}};
  report_plan(one.found, json);
  json["beyond_measured"] = one.found.outside;
  return json;
}

std::string step_text(const GradientStep& one) {
  const segment::SegmentSettings& keys = one.found.design.settings;
  const ForwardRun& forward = one.found.forward;
  std::string text =
      fmt::format("{}: wished {}\n", heights_text(one.step.from_mm, one.step.to_mm), target_text(one.step.target));
  text += one.found.met ? fmt::format("  is        {}; within {:.1f} %\n", predicted_lines(forward), 100 * one.found.miss)
                        : fmt::format("  nearest   {}; not reachable, misses the wish by {:.0f} %\n", predicted_lines(forward),
                                      100 * one.found.miss);
  text += fmt::format("  lines     {}\n  laid at   {:g} % extrusion, thick {:g} %, thin {:g} % of the speed\n",
                      lines_text(keys), keys.thick_extrusion, *keys.thick_speed, keys.thin_speed);
  if (!forward.resolved) text += "  note      voxels are too coarse for the pores; take a smaller --voxel\n";
  for (const std::string& line : one.found.outside) text += fmt::format("  beyond    {}\n", line);
  return text;
}

}  // namespace

std::string predicted_lines(const ForwardRun& forward) {
  return fmt::format("porosity {:.2f} %, k1 {:.4g} +- {:.2g} D along z, pores {:.3f} x {:.2f} mm", 100 * forward.porosity,
                     forward.permeability_m2 / segment::kDarcy, forward.permeability_error_m2 / segment::kDarcy,
                     forward.pore_width_mm, forward.pore_length_mm);
}

std::string as_text(const DesignedJob& found) {
  const segment::SegmentSettings& keys = found.design.settings;
  const ForwardRun& forward = found.forward;
  std::string text = fmt::format("lines     {}\nlaid at   {:g} % extrusion, thick {:g} %, thin {:g} % of the speed\n",
                                 lines_text(keys), keys.thick_extrusion, *keys.thick_speed, keys.thin_speed);
  text += fmt::format("porosity  {:.2f} %, {:.2f} % leads through along z\n", 100 * forward.porosity,
                      100 * forward.porosity_through);
  text +=
      fmt::format("along z   k1 {:.4g} +- {:.2g} D ({:.4e} m2), throat {:.3f} mm\n", forward.permeability_m2 / segment::kDarcy,
                  forward.permeability_error_m2 / segment::kDarcy, forward.permeability_m2, found.design.slots.throat_mm);
  text += fmt::format("pores     {:.3f} x {:.2f} mm\n", forward.pore_width_mm, forward.pore_length_mm);
  text += kSure;
  if (!found.widths.empty()) text += fmt::format("widths    {}\n", found.widths);
  if (!forward.resolved) text += "note      voxels are too coarse for the pores; take a smaller --voxel\n";
  for (const std::string& line : found.outside) text += fmt::format("beyond    {}\n", line);
  if (found.outside.empty()) text += "beyond    nothing: lengths, gaps and extrusion are those that were measured\n";
  return text + fmt::format("checked   by {} forward run{}; the wish is met within {:.1f} %\n", found.runs,
                            found.runs == 1 ? "" : "s", 100 * found.miss);
}

Json as_json(const DesignedJob& found, const std::string& output) {
  Json json{{"command", "design"}, {"met", found.met}, {"miss", found.miss}, {"job", output}};
  report_plan(found, json);
  json["runs"] = found.runs;
  json["k1_over_slots"] = found.model_ratio;
  json["widths"] = found.widths;
  json["beyond_measured"] = found.outside;
  return json;
}

std::string as_text(const GradientJob& found) {
  std::string text;
  for (const GradientStep& one : found.steps) text += step_text(one);
  text += fmt::format(
      "whole     porosity {:.2f} %, k1 of the regions in series {:.4g} D along z; where two meet, pores lie upon\n"
      "          each other only in part, which takes more\n",
      100 * found.porosity, found.permeability_m2 / segment::kDarcy);
  text += kSure;
  if (const std::string& widths = found.steps.front().found.widths; !widths.empty())
    text += fmt::format("widths    {}\n", widths);
  return text +
         fmt::format("checked   by {} forward runs, the last {} in one file of all regions; wishes are met within {:.1f} %\n",
                     found.runs, found.steps.size(), 100 * found.miss);
}

Json as_json(const GradientJob& found, const std::string& output) {
  Json json = {{"command", "design"}, {"met", found.met}, {"miss", found.miss}, {"job", output}, {"steps", Json::array()}};
  for (const GradientStep& one : found.steps) json["steps"].push_back(step_json(one));
  json["porosity"] = found.porosity;
  json["k1_in_series_darcy"] = found.permeability_m2 / segment::kDarcy;
  json["continuous_lines"] = found.lines;
  json["runs"] = found.runs;
  json["widths"] = found.steps.front().found.widths;
  return json;
}

std::string nearest_text(const segment::PoreTarget& target, const DesignedJob& found) {
  const ForwardRun& forward = found.forward;
  std::string text;
  const auto add = [&](bool requested_range, const std::string& part) {
    if (requested_range) text += (text.empty() ? "" : ", ") + part;
  };
  add(target.porosity.has_value(), fmt::format("--porosity {:.2f}", 100 * forward.porosity));
  add(target.permeability_m2.has_value(), fmt::format("--permeability {:.4g}", forward.permeability_m2 / segment::kDarcy));
  add(target.pore_width_mm.has_value(), fmt::format("--pore {:.3f}x{:.2f}", forward.pore_width_mm, forward.pore_length_mm));
  return text;
}

std::string missed_text(const GradientJob& found) {
  std::size_t missed = 0;
  const GradientStep* first = nullptr;
  for (const GradientStep& one : found.steps) {
    if (one.found.met) continue;
    if (first == nullptr) first = &one;
    ++missed;
  }
  if (first == nullptr) return {};
  return fmt::format("{} of {} regions; from {} nearest to {} is {}, which misses it by {:.0f} %", missed, found.steps.size(),
                     heights_text(first->step.from_mm, first->step.to_mm), target_text(first->step.target),
                     nearest_text(first->step.target, first->found), 100 * first->found.miss);
}

}  // namespace lamina::pipeline
