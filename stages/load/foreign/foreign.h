// stages/load/foreign/foreign.h: names of formats that are not read, so that a refusal says what to do; internal to load.
#pragma once

#include <string>
#include <string_view>

namespace lamina::load {

/// What a file is, by the signature at its beginning, and what to do about it: the end of a sentence that begins with the
/// file's name. "" if the signature is of no known format.
///
/// head  the first bytes, at least 512 where the file has them
std::string foreign_format(std::string_view head);

/// Whether text looks like the program of a machine, which has no signature.
bool is_machine_program(std::string_view head);

}  // namespace lamina::load
