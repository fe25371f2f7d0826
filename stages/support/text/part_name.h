// stages/support/text/part_name.h: names of parts in Open Packaging packages, such as 3MF files.
#pragma once

#include <string>
#include <string_view>

namespace lamina {

/// The name of a part of a package as it is compared: a leading slash, lower case, "%20" decoded, "." and ".." resolved.
///
/// folder  where a name without a leading slash is looked for, such as "/3d/"
/// source  ISO/IEC 29500-2 (Open Packaging Conventions), 6.2 and 6.3
std::string part_name(std::string_view name, std::string_view folder = "/");

}  // namespace lamina
