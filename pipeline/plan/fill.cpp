#include <fmt/format.h>

#include <algorithm>

#include "pipeline/job/decisions.h"
#include "pipeline/job/job.h"
#include "pipeline/job/keys.h"
#include "pipeline/plan/fill.h"
#include "stages/infill/fill.h"
#include "stages/support/text/ranges.h"

namespace lamina::pipeline {
namespace {

/// The name of a key in a job file and on a command line.
std::string named(std::string_view name) {
  for (const auto& key : fill_settings_keys()) {
    if (key.name == name && !key.flag.empty()) return fmt::format("fill.{} ({})", name, key.flag);
  }
  return fmt::format("fill.{}", name);
}

/// Checks mutually exclusive keys. returns "" or an error message
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
  for (const FillInterval& range : ranges) {
    if (range.from <= height && height < range.to) return range.parameters;
  }
  return base;
}

bool FillPlan::fills() const {
  const auto does = [](const infill::FillParameters& p) { return p.walls > 0 || p.pattern != infill::Pattern::kNone; };
  return does(base) || std::ranges::any_of(ranges, [&](const FillInterval& range) { return does(range.parameters); });
}

Result<FillPlan> plan_filling(const FillRequest& request, const FillChanges& part_changes) {
  count(Decision::kFilling);
  const auto wrong = [](std::string_view key, const std::string& what) {
    return Error{Fault::kUsage, fmt::format("{}: {}", key, what)};
  };
  if (const std::string what = contradiction(request.all); !what.empty()) return Error{Fault::kUsage, what};
  FillSettings settings = request.all;
  apply(part_changes, settings);
  if (const std::string what = contradiction(settings); !what.empty()) return wrong("part.fill", what);
  FillPlan plan;
  plan.base = infill::parameters_of(settings);
  if (Status status = infill::check(plan.base); !status) {
    return wrong(part_changes.empty() ? "fill" : "part.fill", status.error().message);
  }
  for (const FillRange& range : request.ranges) {
    FillSettings own = settings;
    apply(range.changes, own);
    const std::string name = fmt::format("fill.range: {}", range_name(range.from_mm, range.to_mm));
    if (const std::string what = contradiction(own); !what.empty()) return wrong(name, what);
    plan.ranges.push_back({nm_of(range.from_mm), nm_of(range.to_mm), infill::parameters_of(own)});
    if (Status status = infill::check(plan.ranges.back().parameters); !status) return wrong(name, status.error().message);
  }
  std::ranges::sort(plan.ranges, {}, &FillPlan::FillInterval::from);
  return plan;
}

}  // namespace lamina::pipeline
