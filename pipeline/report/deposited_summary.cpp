#include "pipeline/report/deposited_summary.h"

#include <fmt/format.h>

#include <array>
#include <string_view>

#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

/// The share of a speed that stretches come up to without a warning.
constexpr double kNearStated = 0.75;

double mean(double sum, std::uint64_t count) { return count > 0 ? sum / static_cast<double>(count) : 0; }

std::string pores_text(const DepositedRange& range) {
  const PoreCounts& p = range.pores;
  std::string text = range.heights.empty() ? "" : range.heights + ": ";
  if (p.closed == 0) text += "none closes";
  if (p.closed > 0) {
    text += fmt::format("{} of {:.2f} x {:.3f} mm (ratio {:.2f}), {:.2f} a mm2 of layer", readable_count(p.closed),
                        mean(p.length_mm, p.closed), mean(p.width_mm, p.closed), p.width_mm / p.length_mm,
                        range.area_mm2 > 0 ? static_cast<double>(p.closed) / range.area_mm2 : 0);
  }
  if (p.open > 0) {
    text += fmt::format("; {} stay open: lines {:.3f} mm apart, which thick stretches do not bridge", readable_count(p.open),
                        mean(p.distance_mm, p.open));
  }
  if (p.filled > 0) text += fmt::format("; {} have no room and are filled", readable_count(p.filled));
  if (p.edges > 0) text += fmt::format("; {} at walls and ends of lines", readable_count(p.edges));
  if (p.crossing > 0) {
    text += fmt::format("; {} of {} thin stretches lie under one of the next layer", readable_count(p.crossed),
                        readable_count(p.crossing));
  }
  return text;
}

Json pores_json(const DepositedRange& range) {
  const PoreCounts& p = range.pores;
  return {{"heights", range.heights},
          {"closed", p.closed},
          {"open", p.open},
          {"filled", p.filled},
          {"edges", p.edges},
          {"crossing", p.crossing},
          {"crossed", p.crossed},
          {"length_mm", mean(p.length_mm, p.closed)},
          {"width_mm", mean(p.width_mm, p.closed)},
          {"aspect", p.length_mm > 0 ? p.width_mm / p.length_mm : 0},
          {"density_mm2", range.area_mm2 > 0 ? static_cast<double>(p.closed) / range.area_mm2 : 0}};
}

std::string short_text(const ShortIntervals& shorts, const Extruder& machine) {
  return fmt::format(
      "{} stretches are too short for {:g} mm/s2: the shortest has {:.3f} mm, none comes beyond {:.1f} of {:g} mm/s",
      readable_count(shorts.count), machine.speed.acceleration_mm_s2, shorts.shortest_mm, shorts.reached_mm_s,
      shorts.commanded_mm_s);
}

}  // namespace

void report_deposited(const DepositedSums& sums, const std::vector<DepositedRange>& ranges, const Extruder& machine,
                      std::uint64_t points_first_layer, Lines& lines, Json& facts) {
  const SegmentCounts& segments = sums.segments;
  const PlannedPorosity& porosity = sums.porosity;
  const ShortIntervals& shorts = sums.shorts;
  const bool solid = porosity.solid_mm3 > 0;
  if (segments.intervals > 0) {
    lines.emplace_back("segments",
                       fmt::format("{} lines, {} thick and {} thin stretches, {} points", readable_count(segments.lines),
                                   readable_count(segments.intervals - segments.thin), readable_count(segments.thin),
                                   readable_count(segments.points())));
  }
  if (solid) {
    std::string text = fmt::format("{:.2f} % by what is extruded", 100 * porosity.by_extrusion());
    if (segments.intervals > 0) text += fmt::format(", {:.2f} % by measured widths", 100 * porosity.by_widths());
    lines.emplace_back("porosity", text);
  }
  facts["segments"] = {{"lines", segments.lines}, {"pieces", segments.pieces},   {"intervals", segments.intervals},
                       {"thin", segments.thin},   {"points", segments.points()}, {"points_first_layer", points_first_layer}};
  facts["solid_mm3"] = porosity.solid_mm3;
  facts["porosity"] = {{"by_extrusion", solid ? porosity.by_extrusion() : 0}, {"by_widths", solid ? porosity.by_widths() : 0}};
  facts["pores"] = Json::array();
  for (const DepositedRange& range : ranges) {
    if (ranges.size() == 1 || range.area_mm2 > 0) lines.emplace_back("pores", pores_text(range));  // else no layer lies in it
    facts["pores"].push_back(pores_json(range));
  }
  if (shorts.count > 0) lines.emplace_back("speeds", short_text(shorts, machine));
  facts["too_short"] = {{"intervals", shorts.count},
                        {"shortest_mm", shorts.shortest_mm},
                        {"reached_mm_s", shorts.reached_mm_s},
                        {"commanded_mm_s", shorts.commanded_mm_s}};
}

void report_bead(const Extruder& machine, std::uint32_t left_out, std::string_view cut_at, Lines& lines, Json& facts) {
  constexpr std::array<std::string_view, 3> kShapes{"stadium", "rectangle", "ellipse"};
  const auto& material = machine.material;
  const std::string_view shape = kShapes[static_cast<std::size_t>(material.shape())];
  std::string text = fmt::format("100 % is a {} of the bead's width and the layer's height", shape);
  if (material.flow != 1) text += fmt::format(" x {:g}", material.flow);
  if (!material.bead_area && material.flow != 1) text += " (the profile has a flow and no bead_area)";
  if (material.feed_ratio != 1) text += fmt::format("; the machine feeds {:g} of what E says", material.feed_ratio);
  lines.emplace_back("bead", text);
  facts["bead"] = {{"area", shape}, {"flow", material.flow}, {"feed_ratio", material.feed_ratio}};
  facts["layers_left_out"] = left_out;
  if (left_out == 0) return;
  lines.emplace_back("top", fmt::format("{} more layer{} left out: empty, the {} lies above the parts", left_out,
                                        left_out == 1 ? " is" : "s are", cut_at));
}

std::string speed_warning(const ShortIntervals& shorts, const Extruder& machine) {
  return shorts.reached_mm_s < kNearStated * shorts.commanded_mm_s ? short_text(shorts, machine) : std::string();
}

}  // namespace lamina::pipeline
