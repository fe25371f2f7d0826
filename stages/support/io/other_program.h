// stages/support/io/other_program.h: runs a helper program, as a filter or in place of this process.
//
// A helper is searched beside this program, then in PATH.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

/// Replaces the process by a program. Returns only if the start fails. errors  kInternal
Error hand_over(const std::string& program, const std::vector<std::string>& arguments);

/// Runs a program as a filter: `input` on its standard input.
/// returns  its standard output, which is the error text if it fails
/// errors   its own, under its exit code; kInternal: the start failed, or a signal ended it
/// cost     a process; input and output are held in memory
Result<std::string> filter(const std::string& program, const std::string& argument, std::string_view input);

}  // namespace lamina
