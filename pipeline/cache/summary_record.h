// pipeline/cache/summary_record.h: the summary of a job as a record that its summary can be made of again.
#pragma once

#include <span>
#include <string>

#include "pipeline/report/summary.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// What a summary says of the job itself: no times, no memory, no output.
Json summary_record(const Summary& summary);

/// The summary of the same job with parts of other names.
/// paths   of the parts, in the order of the job
/// errors  throws JsonError: no such record, or another number of parts
Summary summary_of_record(const Json& record, std::span<const std::string> paths);

}  // namespace lamina::pipeline
