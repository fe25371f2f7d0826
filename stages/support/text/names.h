// stages/support/text/names.h: suggestions for mistyped names.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace lamina {

/// "; did you mean 'layer'?" for the known name at the least edit distance, or "" if none is near.
std::string suggest(std::string_view mistyped, std::span<const std::string_view> known);

}  // namespace lamina
