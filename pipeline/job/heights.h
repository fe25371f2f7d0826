// pipeline/job/heights.h: [heights] of a job: how its layers are decided.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/heights/settings.h"

namespace lamina::heights {
struct Options;
}

namespace lamina::pipeline {

struct Job;

/// [heights] of a job as the stage takes it, checked. errors  kUsage, one line that begins with the key
Result<heights::Options> heights_options(const Job& job);

/// What a person is told of [heights]: "of 0.05 mm", "of 0.05..0.3 mm, optimal, steps up to 0.1 mm".
std::string heights_text(const Job& job);

}  // namespace lamina::pipeline
