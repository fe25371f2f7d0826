// pipeline/job/profiles/printer.h: profiles of powder printers as TOML (pipeline/machine/shipped/printers/*.toml,
// docs/reference/machines.md).
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/profiles/library.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Reads a profile from its files, at least one. Every key has a default; unknown keys are refused.
/// dialects  the available dialects of print programs: the profile names one or uses the default
/// errors    kUsage: place, key, reason
Result<Machine> read_machine(const ProfileFiles& files, std::span<const std::string_view> dialects);

/// The text with every key of a profile: equal machines have equal texts, and reading it restores the machine.
std::string machine_text(const Machine& machine);

/// The text that a job writes next to its programs: without the keys of optional equipment at their defaults.
std::string kept_machine_text(const Machine& machine);

/// The words of powder.vat_rule. returns "" or an error message
std::string read_vat_rule(std::string_view text, VatRule& rule);
std::string vat_rule_text(VatRule rule);
std::vector<std::string_view> vat_rule_words();

/// An error in the name of a material, or "". Names consist of letters, digits, - and _, because file names contain them, and
/// do not end like the name of a drop.
std::string check_material(std::string_view name);
/// The same of two materials of a job, whose names may not differ in case alone.
std::string check_case(std::string_view one, std::string_view other);

}  // namespace lamina::pipeline
