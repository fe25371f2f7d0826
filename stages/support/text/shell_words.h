// stages/support/text/shell_words.h: the words of a line, as a shell reads them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

/// The words of a line as a shell splits them: at blanks outside '...' and "..."; a backslash makes the next character
/// literal (within '...' the backslash itself is literal); # at the start of a word begins a comment.
/// Nothing is expanded. errors  kUsage: an unclosed quote
Result<std::vector<std::string>> split_words(std::string_view line);

}  // namespace lamina
