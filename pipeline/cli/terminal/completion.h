// pipeline/cli/terminal/completion.h: scripts that make a shell complete commands, options, their values, and files by their
// endings.
#pragma once

#include <span>
#include <string>

#include "pipeline/cli/terminal/arguments.h"

namespace lamina::pipeline {

std::string bash_completion(std::span<const CommandSpec> commands);
std::string zsh_completion(std::span<const CommandSpec> commands);
std::string fish_completion(std::span<const CommandSpec> commands);

}  // namespace lamina::pipeline
