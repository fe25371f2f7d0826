#include "pipeline/output/plan_head.h"

#include <filesystem>

#include <fmt/format.h>

#include "pipeline/job/file.h"
#include "pipeline/job/keys.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/version.h"

namespace lamina::pipeline {
namespace {

/// A section of the job, key by key.
std::string section_text(const Job& job, std::string_view section) {
  std::string text = fmt::format("\n[{}]\n", section);
  for (const JobKey& key : job_keys()) {
    const std::string value = key.section == section ? key.write(job) : std::string();
    if (!value.empty()) text += fmt::format("{} = {}\n", key.name, json_string(value));
  }
  return text;
}

}  // namespace

ManifestHead plan_head(const Plan& plan) {
  ManifestHead head;
  head.product = plan.product;
  head.version = version();
  head.job_toml = canonical_job_text(plan.job);
  if (plan.product == Product::kContours) head.job_toml += section_text(plan.job, "slice");
  if (plan.sections) head.job_toml += section_text(plan.job, "fill");
  if (plan.segments) head.job_toml += section_text(plan.job, "segment");
  if (plan.product == Product::kMoves) head.job_toml += section_text(plan.job, "extrude");
  head.layer_count = plan.layer_count;
  head.first_layer = plan.range[0];
  head.last_layer = plan.range[1];
  head.parts = plan.scene->parts;
  for (PartSummary& part : head.parts) part.path = std::filesystem::path(part.path).filename().string();
  return head;
}

}  // namespace lamina::pipeline
