// pipeline/cli/markdown_page.h: the page of a command in docs/commands, made from its definition.
#pragma once

#include <string>

#include "pipeline/cli/command.h"

namespace lamina::pipeline {

/// Synopsis, operands, every option with its meaning and default, examples, and where the documentation says more.
std::string markdown_page(const Command& command);

}  // namespace lamina::pipeline
