// stages/text/escape.h: text within the languages that manual pages, web pages and shells are written in.
//
// Each function takes any text and gives what shows as that text; none has errors.
// cost  one pass
#pragma once

#include <string>
#include <string_view>

namespace lamina {

/// Within a page for man: backslashes, dashes, and dots and quotes at the beginning of a line.
std::string roff(std::string_view text);

/// Within a cell of a Markdown table, on one line.
std::string markdown_cell(std::string_view text);

/// As code within a cell of a Markdown table, in backticks.
std::string markdown_code(std::string_view text);

/// Within [...] of an argument of zsh's _arguments, within single quotes.
std::string zsh_argument(std::string_view text);

/// A word of fish, in single quotes.
std::string fish_word(std::string_view text);

}  // namespace lamina
