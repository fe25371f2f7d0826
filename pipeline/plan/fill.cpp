#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/job/job.h"
#include "pipeline/plan/fill.h"
#include "pipeline/text/ranges.h"
#include "stages/infill/fill.h"

namespace lamina::pipeline {
namespace {

Nm short_nm(double millimetres) { return static_cast<Nm>(nm_of(millimetres)); }
MicroDegrees micro(double degrees) { return std::llround(degrees * 1e6); }

std::vector<Nm> list_nm(const std::vector<double>& list) {
  std::vector<Nm> nm;
  for (const double value : list) nm.push_back(short_nm(value));
  return nm;
}

infill::FillParameters parameters_of(const FillSettings& settings) {
  infill::FillParameters p;
  p.pattern = settings.pattern;
  p.width = short_nm(settings.width_mm);
  p.wall_width = settings.wall_width_mm > 0 ? short_nm(settings.wall_width_mm) : p.width;
  p.walls = settings.walls;
  p.loops = settings.loops;
  p.angle_base = micro(settings.angle_deg);
  p.angle_step = micro(settings.angle_step_deg);
  p.build_layers = settings.build_layers;
  p.gaps = list_nm(settings.gap_mm);
  p.group = settings.group;
  for (const auto& [z, gap] : settings.gap_by_height) p.gap_table.emplace_back(nm_of(z), short_nm(gap));
  p.gap_expression = settings.gap_formula;
  p.distances = list_nm(settings.distance_mm);
  p.stagger = list_nm(settings.stagger_mm);
  p.stagger_every_layer = settings.stagger_every_layer;
  if (settings.first_line_mm) p.first_line = short_nm(*settings.first_line_mm);
  if (settings.end_inset_mm) p.end_inset = short_nm(*settings.end_inset_mm);
  if (settings.link_mm) p.longest_link = nm_of(*settings.link_mm);
  p.shortest_line = short_nm(settings.shortest_mm);
  p.cell = short_nm(settings.cell_mm);
  return p;
}

/// A key as a job file and a command line name it.
std::string named(std::string_view name) {
  for (const auto& key : fill_settings_keys()) {
    if (key.name == name && !key.flag.empty()) return fmt::format("fill.{} ({})", name, key.flag);
  }
  return fmt::format("fill.{}", name);
}

/// Keys that cannot both hold. returns "" or what is wrong
std::string contradiction(const FillSettings& settings) {
  const auto keys = distance_keys(settings);
  if (keys.size() > 1) {
    return fmt::format("{} and {} both say how far lines lie from each other; give one of them", named(keys[0]),
                       named(keys[1]));
  }
  if (!settings.distance_mm.empty() && settings.group > 1) {
    return fmt::format(
        "{} and {}: groups are of beads with gaps between; write the distances of a group one by one, or give gaps",
        named("distance_mm"), named("group"));
  }
  return {};
}

}  // namespace

const infill::FillParameters& FillPlan::at(std::int64_t height) const {
  for (const Range& range : ranges) {
    if (range.from <= height && height < range.to) return range.parameters;
  }
  return base;
}

bool FillPlan::fills() const {
  const auto does = [](const infill::FillParameters& p) { return p.walls > 0 || p.pattern != infill::Pattern::kNone; };
  return does(base) || std::ranges::any_of(ranges, [&](const Range& range) { return does(range.parameters); });
}

Result<FillPlan> plan_filling(const FillRequest& request, const FillChanges& part_changes) {
  const auto wrong = [](std::string_view key, const std::string& what) {
    return Error{Fault::kUsage, fmt::format("{}: {}", key, what)};
  };
  if (const std::string what = contradiction(request.all); !what.empty()) return Error{Fault::kUsage, what};
  FillSettings settings = request.all;
  apply(part_changes, settings);
  if (const std::string what = contradiction(settings); !what.empty()) return wrong("part.fill", what);
  FillPlan plan;
  plan.base = parameters_of(settings);
  if (Status status = infill::check(plan.base); !status) {
    return wrong(part_changes.empty() ? "fill" : "part.fill", status.error().message);
  }
  for (const FillRange& range : request.ranges) {
    FillSettings own = settings;
    apply(range.changes, own);
    const std::string name = fmt::format("fill.range: {}", range_name(range.from_mm, range.to_mm));
    if (const std::string what = contradiction(own); !what.empty()) return wrong(name, what);
    plan.ranges.push_back({nm_of(range.from_mm), nm_of(range.to_mm), parameters_of(own)});
    if (Status status = infill::check(plan.ranges.back().parameters); !status) return wrong(name, status.error().message);
  }
  std::ranges::sort(plan.ranges, {}, &FillPlan::Range::from);
  return plan;
}

}  // namespace lamina::pipeline
