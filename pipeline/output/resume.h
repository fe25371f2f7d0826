// pipeline/output/resume.h: finds the intact layers of an interrupted job.
#pragma once

#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Reads the manifest of `directory` (finished or partial) and hashes the files it names.
///
/// returns  the records, in layer order, of complete and unchanged files; empty without a manifest
/// errors   kUsage if the manifest belongs to another job (names the key that differs) or covers layers outside this run
/// cost     reads every finished file once, in parallel
Result<std::vector<LayerRecord>> layers_that_hold(const std::string& directory, const std::string& manifest_name,
                                                  const ManifestHead& head);

}  // namespace lamina::pipeline
