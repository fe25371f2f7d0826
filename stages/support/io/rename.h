// stages/support/io/rename.h: gives a file or a directory a name that nothing has.
#pragma once

#include <string>

namespace lamina {

/// Renames within a file system; what has the name `to` stays. File systems that cannot do that in one step check first.
/// returns  0, EEXIST if `to` exists, or the system's error number
int rename_new(const std::string& from, const std::string& to);

}  // namespace lamina
