// stages/support/io/bring.h: gives a finished file of a shard a second name.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "stages/data/status.h"

namespace lamina::write {

/// A link in a shard's folder may lead anywhere; what it leads to is no file of the job.
/// bytes   that the manifest says, if it does
/// errors  kVerification: missing, no plain file, of another size
Status check_plain(const std::string& file, std::optional<std::uint64_t> bytes = {});

/// Links a file to another name, or copies it to another file system. The name appears once the file is whole; what had it is
/// replaced.
/// returns  whether it is a link
/// errors   kOutput
Result<bool> bring_file(const std::string& from, const std::string& to);

}  // namespace lamina::write
