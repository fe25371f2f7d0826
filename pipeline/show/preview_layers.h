// pipeline/show/preview_layers.h: which layers lamina-preview draws, and drawing those that come as shapes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/cli/command.h"
#include "stages/data/status.h"
#include "stages/view/shapes.h"

namespace lamina::pipeline {

/// The number behind a flag; nothing if the flag is absent.
Result<std::optional<std::uint32_t>> whole_number(const Arguments& arguments, std::string_view flag, std::uint32_t least,
                                                  std::uint32_t most);

/// Which of a job's layers --layer, --every or --count ask for: places in the list of their numbers.
Result<std::vector<std::size_t>> chosen_layers(const Arguments& arguments, const std::vector<std::uint32_t>& layers);

/// One layer, or with --every or --count several side by side, into `output`. Says what is wrong and returns the exit code.
int preview_series(const view::LayerSeries& series, const std::string& output, const Arguments& arguments, std::uint32_t width);

}  // namespace lamina::pipeline
