#include "pipeline/report/job_cost.h"

#include <algorithm>

namespace lamina::pipeline {
namespace {

bool separates_parts(const Plan& plan) { return plan.job.quote || cost::has_prices(plan.images->machine->machine.cost); }

}  // namespace

std::size_t reported_parts(const Plan& plan) { return separates_parts(plan) ? plan.scene->parts.size() : 1; }

JobCost::JobCost(const Machine& machine, const Manifest& manifest)
    : account_(machine, manifest.head.grid, manifest.head.parts,
               std::ranges::any_of(manifest.layers, [](const LayerRecord& record) { return !record.part_pixels.empty(); }),
               title_of(manifest.head.parts)),
      drop_pl_(machine.head.drop_pl) {
  for (const JobMaterial& material : manifest.head.materials) {
    if (manifest.head.max_drops > 0) powders_.push_back({material.name});
  }
}

JobCost::JobCost(const Plan& plan)
    : account_(plan.images->machine->machine, plan.images->grid, plan.scene->parts, separates_parts(plan),
               title_of(plan.scene->parts)) {}

void JobCost::add(const LayerRecord& record, std::uint64_t drops, std::int64_t microseconds) {
  if (record.layer.index == 0) account_.tally().add_base();
  account_.tally().add(record.layer.thickness, microseconds, drops, record.filled_pixels(), record.part_pixels,
                       record.part_drops);
  for (std::size_t m = 0; m < powders_.size(); ++m)
    powders_[m].add(record.image_of(m, powders_.size()).set_pixels, record.drops_of(m, powders_.size()));
}

void JobCost::report(Summary& summary) const {
  Json& use = summary.facts["use"];
  account_.report(summary.results, use, summary.quote);
  for (const PowderDrops& powder : powders_) {
    summary.results.emplace_back("", powder_text(powder, drop_pl_));
    use["materials"].push_back(powder_json(powder, drop_pl_));
  }
}

}  // namespace lamina::pipeline
