// pipeline/check/verify_paths.h: are contours or toolpaths what their manifest says.
#pragma once

#include <string>

#include "pipeline/check/verify.h"
#include "pipeline/output/manifest.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Compares what `lamina slice` or `lamina extrude` wrote with its manifest: the bytes of each layer, in the one file or in
/// files of their own, have the recorded hash; layers follow each other without a gap; so does the file as a whole; no
/// other layers lie in layers/.
///
/// name  of the directory or file, for the report
/// cost  reads every file once, the one file of all layers twice
VerifyReport verify_paths(const std::string& name, const std::string& directory, const Manifest& manifest);

}  // namespace lamina::pipeline
