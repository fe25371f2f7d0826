#include "pipeline/plan/raft.h"

#include <string>

#include "stages/data/units.h"

namespace lamina::pipeline {

RaftPlan plan_raft(const ExtrudeRequest& request, Nm thickness) {
  RaftPlan plan;
  for (std::uint32_t i = 0; i < request.raft_layers; ++i) {
    const bool first = i == 0 && request.first_thickness_mm;
    plan.layers.push_back({i, plan.lift, first ? static_cast<Nm>(nm_of(*request.first_thickness_mm)) : thickness});
    plan.lift += plan.layers.back().thickness;
  }
  if (!plan.layers.empty()) plan.lift += static_cast<Nm>(nm_of(request.raft_gap_mm));
  return plan;
}

Status check_raft(const Job& job, const Extruder& machine) {
  if (job.extrude.raft_layers == 0) return {};
  const auto refused = [](const char* why) {
    return Error{Fault::kUsage, std::string("extrude.raft_layers (--raft): ") + why};
  };
  if (machine.format == "sml") return refused("a machine of SML deposits its own foundation; leave it out");
  if (job.extrude.brim_mm > 0) return refused("a raft is its own brim; leave out extrude.brim_mm (--brim)");
  if (job.heights.per_part) return refused("with --per-part each part has its own first layer; leave one of them out");
  if (job.layers && (*job.layers)[0] > 0) return refused("--layers begins above the first layer; leave one of them out");
  return {};
}

}  // namespace lamina::pipeline
