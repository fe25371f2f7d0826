// pipeline/report/layer_text.h: numbers of layers in a sentence.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/checks/mixed.h"

namespace lamina::pipeline {

/// "layers 0 to 41, 60 and 72 to 80", at most six ranges, and how many more.
std::string ranges_text(std::span<const sanity::LayerRange> ranges);

/// "pauses before layers 812, 1630 and 4 more for vats to be filled"; empty without refills.
std::string refills_text(const std::vector<std::uint32_t>& refills);

}  // namespace lamina::pipeline
