// pipeline/cli/made_profiles.h: profiles that lamina machines makes: imported from another slicer, or from answers.
#pragma once

#include "pipeline/cli/command.h"

namespace lamina::pipeline {

/// Runs --import or --new: the profile goes to -o or to standard output, notes and settings that were not used to people.
Outcome make_profile(const Arguments& arguments, Context& context);

}  // namespace lamina::pipeline
