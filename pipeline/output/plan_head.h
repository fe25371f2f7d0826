// pipeline/output/plan_head.h: what every manifest says of its plan.
#pragma once

#include "pipeline/plan/plan.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

/// The head of a plan's manifest, without what only its product has.
ManifestHead plan_head(const Plan& plan);

}  // namespace lamina::pipeline
