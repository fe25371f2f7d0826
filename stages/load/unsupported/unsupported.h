// stages/load/unsupported/unsupported.h: names of formats that are not read, so that a refusal says what to do; internal to
// load.
#pragma once

#include <string_view>

#include "stages/data/status.h"
#include "stages/load/source.h"

namespace lamina::load {

/// Refuses a file whose signature is that of a known format that lamina does not read.
/// head    its first bytes, at least 512 where the file has them
/// errors  kInput: the format, and what to do about it
Status refuse_unsupported(const Source& source, std::string_view head);

/// Whether text looks like the program of a machine, which has no signature.
bool is_machine_program(std::string_view head);

}  // namespace lamina::load
