// stages/support/text/escape.h: escapes text for manual pages, Markdown and shells, splits lines, and decodes names of parts.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina {

// Each of the escapes accepts any text and returns its escaped form; none fails. cost  one pass

/// For a man page: backslashes, dashes, and dots and quotes at the start of a line.
std::string roff(std::string_view text);

/// For a cell of a Markdown table, on one line.
std::string markdown_cell(std::string_view text);

/// For code in a cell of a Markdown table, in backticks.
std::string markdown_code(std::string_view text);

/// For [...] in a single-quoted argument of zsh's _arguments.
std::string zsh_argument(std::string_view text);

/// A word of fish, in single quotes.
std::string fish_word(std::string_view text);

// --- bytes as text.

/// Base 64 as in RFC 4648, padded, without line ends.
std::string base64(std::span<const std::byte> bytes);

// --- names of parts in Open Packaging packages, such as 3MF files.

/// The name of a part of a package as it is compared: a leading slash, lower case, "%20" decoded, "." and ".." resolved.
///
/// folder  where a name without a leading slash is searched, such as "/3d/"
/// source  ISO/IEC 29500-2 (Open Packaging Conventions), 6.2 and 6.3
std::string part_name(std::string_view name, std::string_view folder = "/");

// --- words of a line.

/// The words of a line as a shell splits them: at blanks outside '...' and "..."; a backslash makes the next character
/// literal (within '...' the backslash itself is literal); # at the start of a word begins a comment.
/// Nothing is expanded. errors  kUsage: an unclosed quote
Result<std::vector<std::string>> split_words(std::string_view line);

}  // namespace lamina
