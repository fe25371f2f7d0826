// pipeline/pores/design_page.h: designed jobs, as text and as JSON.
#pragma once

#include <string>

#include "pipeline/pores/design.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// What a forward run says: "porosity 24.13 %, k1 101.9 +- 3.3 D along z, pores 0.071 x 1.61 mm"
std::string predicted_lines(const ForwardRun& forward);

/// Lines that end with LF.
std::string as_text(const DesignedJob& found);
/// output  the job file; "" if none was written
Json as_json(const DesignedJob& found, const std::string& output);

/// The same, step by step from the bottom up.
std::string as_text(const GradientJob& found);
Json as_json(const GradientJob& found, const std::string& output);

/// What the nearest is, of what was wished, as options: "--porosity 26.14".
std::string nearest_text(const segment::PoreTarget& target, const DesignedJob& found);

/// Which steps miss their wish, and what is nearest to the first of them; one line.
std::string missed_text(const GradientJob& found);

}  // namespace lamina::pipeline
