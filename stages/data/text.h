// stages/data/text.h: words of files in messages.
#pragma once

#include <string>
#include <string_view>

namespace lamina {

/// The text without line breaks and other control characters, for messages of one line.
std::string one_line(std::string_view text);

}  // namespace lamina
