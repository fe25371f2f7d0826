// pipeline/output/resume.h: which layers of an interrupted job still stand.
#pragma once

#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

/// Reads the manifest of `directory` (finished, or as far as an interrupted run got) and hashes the files it names.
///
/// returns  the records, in layer order, whose file is there, whole and unchanged; empty if there is no manifest
/// errors   kUsage if the manifest belongs to another job (which key differs), or to layers that this one leaves out
/// cost     reads every finished file once, in parallel
Result<std::vector<LayerRecord>> layers_that_hold(const std::string& directory, const std::string& manifest_name,
                                                  const ManifestHead& head);

}  // namespace lamina::pipeline
