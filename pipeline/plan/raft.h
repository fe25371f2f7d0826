// pipeline/plan/raft.h: the layers of a raft, and how far it lifts the parts.
#pragma once

#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/extruder.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct RaftPlan {
  std::vector<Layer> layers;  // numbered from 0, from the bed upwards; empty: no raft
  Nm lift = 0;                // nm from the bed to the bottom of the parts, with the gap between raft and parts
};

/// thickness  nm of the parts' first layer: so thick are those of the raft, but its first one by --first-layer
RaftPlan plan_raft(const ExtrudeRequest& request, Nm thickness);

/// errors  kUsage: a raft with a brim, with layers of parts, without the first layer, or in SML
Status check_raft(const Job& job, const Extruder& machine);

}  // namespace lamina::pipeline
