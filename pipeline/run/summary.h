// pipeline/run/summary.h: what a job did, for a person and for a script.
#pragma once

#include <string>

#include "pipeline/run/jet.h"

namespace lamina::pipeline {

/// Aligned lines with units; ends with one line a warning.
std::string summary_text(const Job& job, const JetSummary& summary);

/// One JSON object on one line. Lengths in mm or nm, times in seconds and sizes in bytes, as the keys say.
std::string summary_json(const Job& job, const JetSummary& summary);

}  // namespace lamina::pipeline
