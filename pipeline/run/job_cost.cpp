#include "pipeline/run/job_cost.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pipeline/run/sanity.h"
#include "stages/cost/told.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

JobCost::JobCost(const Plan& plan)
    : machine_(plan.images->machine->machine),
      tally_(machine_, plan.images->grid, plan.scene->images.empty() ? plan.scene->parts.size() : 1) {
  for (const PartSummary& part : plan.scene->parts) names_.push_back(part.path);
  // What images set is nobody's window: with them the job is told as one.
  if (!plan.scene->images.empty()) names_ = {title_of(plan.scene->parts)};
  if (names_.size() < 2 || !cost::has_prices(machine_.cost)) return;
  std::vector<cost::Body> bodies;
  for (const sanity::Solid& solid : solids_from_above(*plan.scene)) bodies.push_back({solid.box, solid.part, solid.group});
  const Mirror mirror = plan.job.mirror;
  const bool mirrored = mirror != Mirror::kNone;
  windows_.emplace(bodies, names_.size(), plan.images->grid, mirrored && mirror != Mirror::kY,
                   mirrored && mirror != Mirror::kX);
}

void JobCost::count(const RunsView& image, LayerRecord& record) const {
  if (windows_) record.part_pixels = windows_->count(record.layer, image);
}

void JobCost::add(const LayerRecord& record) {
  if (record.layer.index == 0) tally_.add_base();
  tally_.add(record.layer.thickness, record.program.microseconds, record.program.drops + record.program.spat,
             std::max(record.set_pixels, record.dosed_pixels), record.part_pixels);
}

void JobCost::tell(Summary& summary) const {
  const cost::Quote quote = tally_.quote();
  for (auto& line : cost::lines_of(quote, machine_.cost, names_)) summary.results.push_back(std::move(line));
  (*summary.facts)["use"] = cost::json_of(quote, machine_.cost, names_);
}

}  // namespace lamina::pipeline
