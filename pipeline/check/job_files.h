// pipeline/check/job_files.h: what a finished job left in its directory, read again.
#pragma once

#include <string>

#include "pipeline/output/print_program.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/replay/machine.h"
#include "stages/write/manifest/compare.h"

namespace lamina::pipeline {

/// The machine of program/machine.toml, which has to be the one that the manifest records.
/// errors  kVerification: missing, changed, or not this job's; begins with the file's name within the directory
Result<replay::VirtualMachine> machine_of_job(const std::string& directory, const ManifestHead& head);

/// The text of a layer's print program, whatever it holds; "" if it cannot be read.
std::string program_of_layer(const std::string& directory, const ManifestHead& head, std::uint32_t layer);

/// All materials of a layer as one image, of the manifest's grid.
/// errors  kVerification, with the file: of read::image; of another size; two materials at one place
Result<Runs> picture_of_layer(const std::string& directory, const ManifestHead& head, const LayerRecord& record);

}  // namespace lamina::pipeline
