// pipeline/output/plan_head.h: the manifest keys common to all products.
#pragma once

#include "pipeline/plan/plan.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

/// The manifest head of a plan, without product-specific keys.
ManifestHead plan_head(const Plan& plan);

}  // namespace lamina::pipeline
