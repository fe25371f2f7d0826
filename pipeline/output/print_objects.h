// pipeline/output/print_objects.h: the parts of a job as objects that firmwares can leave out.
#pragma once

#include <vector>

#include "pipeline/plan/sections.h"
#include "stages/formats/extrusion_format.h"

namespace lamina::pipeline {

/// One for each body: instances that touch are one object. Names are those of files, without what firmwares do not accept, and
/// numbered where two would be the same.
std::vector<formats::ExtrusionObject> print_objects(const Sections& sections);

}  // namespace lamina::pipeline
