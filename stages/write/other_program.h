// stages/write/other_program.h: another program that does what this one has no libraries for, as a filter or in its place.
//
// A program stands beside this one, or else somewhere in PATH.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::write {

/// Hands the process over to a program. Returns only if it cannot be started. errors  kInternal
Error hand_over(const std::string& program, const std::vector<std::string>& arguments);

/// Runs a program as a filter: `input` on its standard input.
/// returns  what it writes to standard output; if it fails, that is its error
/// errors   its own, under its exit code; kInternal: it cannot be started, or a signal ended it
/// cost     a process; input and output are held in memory
Result<std::string> filter(const std::string& program, const std::string& argument, std::string_view input);

}  // namespace lamina::write
