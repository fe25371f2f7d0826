// pipeline/cli/help/help.h: pages and shell completion, made from the definitions that commands read their arguments by.
#pragma once

#include <string>

#include "pipeline/cli/command.h"

namespace lamina::pipeline {

/// What makes a shell complete commands and options.
std::string bash_completion();
std::string zsh_completion();
std::string fish_completion();

/// The manual page of the program.
std::string man_page();
/// That of a command.
std::string man_page(const Command& command);

/// The page of a command in docs/commands: synopsis, operands, every option with its meaning and default, examples, and
/// where the documentation says more.
std::string markdown_page(const Command& command);

}  // namespace lamina::pipeline
