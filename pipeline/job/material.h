// pipeline/job/material.h: the powders that parts of a job name.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct Job;

/// Reads the name of a material: letters, digits, - and _, as it stands in file names too. returns "" or what is wrong
std::string read_material(std::string_view text, std::string& name);

/// Gives the parts of a job their materials: "steel" to all, or "steel,bronze" one to each in their order.
/// errors  kUsage: another number of names, or one that is none
Status set_materials(std::string_view names, Job& job);

/// Another material from a height to the next, in mm above the bottom of a part.
struct MaterialRange {
  double from_mm = 0, to_mm = 0;
  std::string material;
};
/// Reads "2:4 bronze; 4:6 steel". Where ranges overlap, the last one counts. returns "" or what is wrong
std::string read_material_ranges(std::string_view text, std::vector<MaterialRange>& ranges);

}  // namespace lamina::pipeline
