// pipeline/cli/terminal/pages.h: manual pages, pages in Markdown and completion scripts, made from the definitions of the
// commands.
#pragma once

#include <span>
#include <string>

#include "pipeline/cli/terminal/arguments.h"

namespace lamina::pipeline {

/// The manual page of the program.
std::string man_page(std::span<const CommandSpec> commands);
/// The manual page of a command.
std::string man_page(const CommandSpec& command);

/// The page of a command in docs/reference/commands: synopsis, operands, every option with meaning and default, examples, and
/// links to further documentation.
std::string markdown_page(const CommandSpec& command);

/// Scripts that make a shell complete commands, options, their values, and files by their endings.
std::string bash_completion(std::span<const CommandSpec> commands);
std::string zsh_completion(std::span<const CommandSpec> commands);
std::string fish_completion(std::span<const CommandSpec> commands);

}  // namespace lamina::pipeline
