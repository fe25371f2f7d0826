// stages/support/hash/tree.h: the fingerprint of a directory whose files are known.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "stages/support/hash/hash.h"

namespace lamina {

/// What digest_tree() returns for a directory with these files. files  paths in it, in any order; of a single file "."
TreeDigest digest_of(std::vector<std::pair<std::string, FileDigest>> files);

}  // namespace lamina
