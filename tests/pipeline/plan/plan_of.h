// tests/pipeline/plan/plan_of.h: plans of jobs that a test makes up.
#pragma once

#include <utility>

#include "pipeline/plan/plan.h"

namespace lamina::test {

inline Result<pipeline::Plan> plan_of(const pipeline::Job& job, Product product) {
  auto resolved = pipeline::resolve(job, product);
  if (!resolved) return resolved.error();
  return pipeline::make_plan(std::move(*resolved), [](const pipeline::ProgressEvent&) {});
}

}  // namespace lamina::test
