// stages/write/bring.h: gives a finished file a second name.
#pragma once

#include <string>

#include "stages/data/status.h"

namespace lamina::write {

/// Links a file to another name, or copies it to another file system. The name appears once the file is whole; what had it is
/// replaced.
/// returns  whether it is a link
/// errors   kOutput
Result<bool> bring_file(const std::string& from, const std::string& to);

}  // namespace lamina::write
