// stages/text/names.h: what somebody who mistyped a name probably meant.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace lamina {

/// "; did you mean 'layer'?" for the known name that is the fewest edits away, or "" if none is near.
std::string suggest(std::string_view mistyped, std::span<const std::string_view> known);

}  // namespace lamina
