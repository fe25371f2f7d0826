// pipeline/cli/help/help.h: manual pages and shell completion, generated from the argument definitions.
#pragma once

#include <string>

#include "pipeline/cli/command.h"

namespace lamina::pipeline {

/// The completion script of a shell, for commands and options.
std::string bash_completion();
std::string zsh_completion();
std::string fish_completion();

/// The manual page of the program.
std::string man_page();
/// The manual page of a command.
std::string man_page(const Command& command);

/// The page of a command in docs/commands: synopsis, operands, every option with meaning and default, examples, and
/// links to further documentation.
std::string markdown_page(const Command& command);

}  // namespace lamina::pipeline
