// pipeline/check/replay_job.h: the machine of a finished job, found again in its directory.
#pragma once

#include <string>

#include "pipeline/output/manifest.h"
#include "pipeline/output/print_program.h"
#include "stages/data/status.h"
#include "stages/replay/machine.h"

namespace lamina::pipeline {

/// The machine of program/machine.toml, which has to be the one that the manifest records.
/// errors  kVerification: missing, changed, or not this job's; begins with the file's name within the directory
Result<replay::VirtualMachine> machine_of_job(const std::string& directory, const ManifestHead& head);

/// The text of a layer's print program, whatever it holds; "" if it cannot be read.
std::string program_of_layer(const std::string& directory, const ManifestHead& head, std::uint32_t layer);

}  // namespace lamina::pipeline
