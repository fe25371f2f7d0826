// stages/support/text/json_text.h: JSON text without a document tree, for speed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace lamina {

/// The text in quotes, escaped for JSON (and for TOML's basic strings); bytes that are not UTF-8 become U+FFFD.
std::string json_string(std::string_view text);

/// Whether the bytes are UTF-8.
bool is_utf8(std::string_view text);

// --- bounds on nesting, checked before a parser that recurses sees the text.

/// No file of lamina nests deeper.
inline constexpr std::uint32_t kDeepestText = 16;

/// Whether the objects and lists of a JSON text nest at most so deep; strings are passed over.
bool json_nests_within(std::string_view text, std::uint32_t maximum = kDeepestText);

}  // namespace lamina
