// stages/load/order_zip.h: the part files and tables of a ZIP archive, unpacked into a folder.
#pragma once

#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::load {

/// Unpacks the part files and CSV tables of an archive under their own names, in folders as there; other entries are left.
///
/// folder   is made, if it is not there
/// returns  their paths in the folder, in the order of names
/// errors   kInput: no whole ZIP file, encrypted, a name that leads out of the folder, more than 8 GiB or 200-fold, nothing of
///          use in it; kOutput
Result<std::vector<std::string>> unpack_order(const std::string& path, const std::string& folder);

}  // namespace lamina::load
