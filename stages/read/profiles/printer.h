// stages/read/profiles/printer.h: profiles of powder printers as TOML (stages/write/machines/*.toml, docs/machines.md).
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::read {

/// Reads a profile. Every key has a default; unknown ones are refused.
/// where     names it in messages
/// dialects  that programs can be written in: the profile names one of them, or leaves it at the default
/// errors    kUsage: place, key, what is wrong
Result<Machine> read_machine(std::string_view text, const std::string& where, std::span<const std::string_view> dialects);

/// Every key of a profile: equal machines have equal texts, and reading it back gives the same machine.
std::string machine_text(const Machine& machine);

/// What is wrong with the name of a material, or ""; it has letters, digits, - and _, as it stands in file names too.
std::string check_material(std::string_view name);

}  // namespace lamina::read
