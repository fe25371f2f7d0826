// pipeline/cli/pore_job.h: lamina permeability of a job file.
#pragma once

#include <optional>
#include <string>

#include "pipeline/cli/command.h"
#include "stages/data/mesh.h"

namespace lamina::pipeline {

/// Whether an operand is a job file, by how its name ends: .toml.
bool names_job(const std::string& path);

/// Predicts what flows through the files of a call.
/// part  of toolpaths: the box that the window lies in the middle of, machine coordinates; none: that of all beads
using Predict = Outcome (*)(const Arguments& arguments, Context& context, const std::optional<Box>& part);

/// Plans the job of the first operand as lamina extrude or lamina jet does, with parts of the other operands in place of its
/// own, --set and --machine, and predicts what was written: G-code or bitmaps in a temporary folder, in the place of the job.
/// The machine decides which of the two; a job without one its first line as lamina saves it, or keys that one of the two
/// reads alone.
/// errors  those of reading, checking and running a job, and of predict, with the job's name; kUsage: it is unknown which
/// of the
///         two, toolpaths of another format than G-code
Outcome predict_job(const Arguments& arguments, Context& context, Predict predict);

}  // namespace lamina::pipeline
