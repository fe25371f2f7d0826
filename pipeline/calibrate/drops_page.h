// pipeline/calibrate/drops_page.h: what there is to say of measured pressure drops, for people and for programs.
#pragma once

#include <string>

#include "stages/data/plot.h"
#include "stages/segment/permeability.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Lines that end with LF: the pooled fit, samples and their spread, the same for gases.
std::string as_text(const segment::DropsFit& fit);
Json as_json(const segment::DropsFit& fit);
/// Points and parabola, of gases if requested.
Plot draw(const segment::DropsFit& fit);

}  // namespace lamina::pipeline
