// pipeline/nest/sheet.h: the page that goes with a build through the shop: pictures, parts, what comes out first, signatures.
#pragma once

#include <string>
#include <vector>

#include "pipeline/nest/nest.h"

namespace lamina::pipeline {

/// What a sheet says of a build, besides its parts.
struct SheetHead {
  std::string title;    // "week, build 1 of 2"
  std::string machine;  // name; may be empty
  std::string hash;     // of the build's job file
  std::string presets;  // of powder and binder; may be empty
};

/// HTML without scripts and other files, for A4: the bed from above and from the side with numbered parts, the parts with
/// serial numbers, positions and heights, and the order in which they appear when the powder is removed from the top.
///
/// serials  of each row's copies
/// cost     O(parts + cells of their shapes)
std::string sheet_html(const SheetHead& head, const NestPlan& plan, const NestBuild& build, const std::vector<OrderRow>& rows,
                       const std::vector<std::vector<std::string>>& serials);

}  // namespace lamina::pipeline
