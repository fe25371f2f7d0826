// pipeline/show/slice_series.h: the layers of a sliced job again, as shapes to look at.
#pragma once

#include <string>

#include "stages/data/status.h"
#include "stages/view/shapes.h"

namespace lamina::pipeline {

/// The job that lamina slice left in a directory (job.toml), planned again from its parts.
/// errors  kUsage; kInput: a part that cannot be read. Of a layer: kUsage: there is none of that number; kVerification: a part
///         that is not what it was
Result<view::LayerSeries> slice_series(const std::string& directory);

}  // namespace lamina::pipeline
