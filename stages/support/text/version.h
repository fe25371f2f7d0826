// stages/support/text/version.h: which lamina this is.
#pragma once

#include <string_view>

namespace lamina {

/// As in "0.1.0".
std::string_view version();

}  // namespace lamina
