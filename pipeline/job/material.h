// pipeline/job/material.h: the powders that parts of a job name.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct Job;
struct Place;
struct TomlValue;

/// Another material from a height to the next, in mm above the bottom of a part. Where ranges overlap, the last one counts.
struct MaterialRange {
  double from_mm = 0, to_mm = 0;
  std::string material;
};

/// What is wrong with the name of a material, or ""; it has letters, digits, - and _, as it stands in file names too.
std::string check_material(std::string_view name);

/// Gives the parts of a job their materials: "steel" to all, or "steel,bronze" one to each in their order.
/// errors  kUsage: another number of names, or one that is none
Status set_materials(std::string_view names, Job& job);

/// Reads an array of tables { from_mm, to_mm, material }. returns "" or what is wrong; at  where
std::string read_material_ranges(const TomlValue& list, std::vector<MaterialRange>& ranges, Place& at);
std::string material_ranges_text(const std::vector<MaterialRange>& ranges);

}  // namespace lamina::pipeline
