#include "pipeline/output/plan_head.h"

#include <filesystem>

#include "pipeline/job/file.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {

ManifestHead plan_head(const Plan& plan) {
  ManifestHead head;
  head.product = plan.product;
  head.version = version();
  head.job_toml = canonical_job_text(plan.job, plan.product);
  head.layer_count = plan.layer_count;
  head.first_layer = plan.range[0];
  head.last_layer = plan.range[1];
  head.parts = plan.scene->parts;
  for (PartSummary& part : head.parts) part.path = std::filesystem::path(part.path).filename().string();
  return head;
}

}  // namespace lamina::pipeline
