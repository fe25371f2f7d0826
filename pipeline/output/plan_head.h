// pipeline/output/plan_head.h: what every manifest says of its plan.
#pragma once

#include "pipeline/output/manifest.h"
#include "pipeline/plan/plan.h"

namespace lamina::pipeline {

/// The head of a plan's manifest, without what only its product has.
ManifestHead plan_head(const Plan& plan);

}  // namespace lamina::pipeline
