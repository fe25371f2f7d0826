// pipeline/job/heights.h: section [heights] of a job: how its layers are decided.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/heights/settings.h"

namespace lamina::heights {
struct Options;
}

namespace lamina::pipeline {

struct Job;

/// Section [heights] as checked options of the stage. errors  kUsage, one line that begins with the key
Result<heights::Options> heights_options(const Job& job);

}  // namespace lamina::pipeline
