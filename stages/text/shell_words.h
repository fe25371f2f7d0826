// stages/text/shell_words.h: the words of a line, as a shell reads them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

/// The words of a line as a shell reads them: split at blanks; '...' and "..." hold blanks, a backslash takes the next
/// character as it is (within '...' too it is an ordinary character), # begins a comment where a word could begin.
/// Nothing is expanded. errors  kUsage: a quote that is not closed
Result<std::vector<std::string>> split_words(std::string_view line);

}  // namespace lamina
