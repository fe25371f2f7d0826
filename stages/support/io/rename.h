// stages/support/io/rename.h: gives a file or a directory a name that nothing has.
#pragma once

#include <string>

namespace lamina {

/// Renames within a file system; what has the name `to` stays. File systems that cannot do that in one step (NFS) link the new
/// name and remove the old one; directories, and all files where there are no links, are checked first.
/// returns  0, EEXIST if `to` exists, or the system's error number
int rename_new(const std::string& from, const std::string& to);
/// The same in one step. returns  EINVAL or ENOSYS where the system cannot do that
int rename_in_one_step(const std::string& from, const std::string& to);
/// The same where the system cannot do it in one step.
int rename_new_by_link(const std::string& from, const std::string& to);

}  // namespace lamina
