// pipeline/machine/printer_profile.h: machine profiles as TOML, shipped with the program or from a file.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// A profile that is part of the program (stages/write/machines/*.toml).
struct ShippedMachine {
  std::string_view name, text;
};
std::span<const ShippedMachine> shipped_machines();

/// Reads a profile. `where` names it in messages. Every key has a default; unknown ones are refused.
/// errors  kUsage: place, key, what is wrong; an unknown dialect
Result<Machine> read_machine(std::string_view text, const std::string& where);

/// The profile of that name, or in that file (anything with a slash or that ends in .toml).
/// errors  kUsage, with the shipped names
Result<Machine> find_machine(const std::string& name_or_file);

/// Every key of a profile: equal machines have equal texts, and reading it back gives the same machine.
std::string machine_text(const Machine& machine);

}  // namespace lamina::pipeline
