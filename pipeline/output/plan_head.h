// pipeline/output/plan_head.h: the manifest keys common to all products.
#pragma once

#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"

namespace lamina::pipeline {

/// The manifest head of a plan, without product-specific keys.
ManifestHead plan_head(const Plan& plan);

}  // namespace lamina::pipeline
