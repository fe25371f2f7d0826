// pipeline/report/inspection_json.h: what an inspection found, as JSON.
#pragma once

#include "stages/checks/inspect.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// min_mm  least width of what is not thin
Json json_of(const checks::Findings& findings, double min_mm);

}  // namespace lamina::pipeline
