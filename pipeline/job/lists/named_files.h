// pipeline/job/lists/named_files.h: the files that a job file names. Their relative paths begin at its folder, wherever lamina
// runs; profiles and presets that are no paths are names, which stay.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "stages/data/status.h"
#include "stages/support/text/toml.h"

namespace lamina::pipeline {

/// Profiles that a job file names and that are not there, with what to say of each.
using MissingProfiles = std::vector<std::pair<std::string, std::string>>;

/// Makes part.path, run.output, machine.profile and machine.presets of a job's tree paths from the working directory.
/// file  the job file, for its folder and for messages; of a stream paths stay as they are
/// errors  kUsage: a comma in the path of a preset, which divides them
Status replace_paths(TomlValue& job, const std::string& file, MissingProfiles& missing);

/// The way back: a path as a file in `folder` names it, relative if it lies below, else absolute. Unchanged for "".
std::string path_in(const std::string& folder, const std::string& path);
std::string profile_in(const std::string& folder, const std::string& name_or_path);

/// A profile by its file's name alone, as manifests have it.
std::string profile_name(const std::string& name_or_path);

/// errors  kUsage: one that a job needs is missing
Status check_there(const MissingProfiles& missing, const std::string& profile, const std::vector<std::string>& presets);

/// Whether a job file in `folder` can name them. errors  kUsage: a path that is not UTF-8, a preset's with a comma
Status check_nameable(const std::string& folder, const std::string& profile, const std::vector<std::string>& presets);

}  // namespace lamina::pipeline
