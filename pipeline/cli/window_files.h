// pipeline/cli/window_files.h: the options --solid FILE, --void FILE, --plot FILE and --no-flow: a window of voxels taken
// elsewhere.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipeline/cli/terminal/arguments.h"
#include "pipeline/pores/predict_flow.h"
#include "stages/data/plot.h"
#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// One file that was written.
struct WindowFile {
  std::string path, content;  // "solid", "void" or "sections"
  std::uint64_t bytes = 0, facets = 0;
};

/// For the help; --plot is of measurements too.
std::vector<pipeline::OptionSpec> window_file_options();

/// errors  kUsage: an ending of no format; kOutput: no such folder
Status check_window_files(const pipeline::Arguments& arguments);

/// Writes what was asked for; files take their names when all of them are whole.
/// draw    makes the plot of --plot
/// errors  kOutput; kInput: more facets than an STL file counts
Result<std::vector<WindowFile>> write_window_files(const pipeline::Arguments& arguments, const VoxelView& window,
                                                   const std::function<Result<Plot>()>& draw);

/// A line each, which ends with LF.
std::string as_text(const std::vector<WindowFile>& files);
Json as_json(const std::vector<WindowFile>& files);

/// What there is to say of a window without a flow through it.
PoreReport pores_alone(const VoxelView& window);

}  // namespace lamina::pipeline
