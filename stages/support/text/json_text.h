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

/// No file of lamina nests deeper, has keys of more parts, or has more values.
inline constexpr std::uint32_t kDeepestText = 16, kMaxKeyParts = 16, kMaxValues = 1'000'000;

/// A place in a text that goes beyond a bound; `what` is empty if none does.
struct BeyondBound {
  std::string what;
  std::uint32_t line = 0, column = 0;  // from 1
};

/// Brackets and braces, parts of dotted keys (those of table headers too), and values of a TOML text. Strings and comments
/// are passed over. The parser recurses for each part of a key, and holds some 200 bytes a value.
BeyondBound toml_beyond_bounds(std::string_view text);

/// Whether the objects and lists of a JSON text nest at most so deep; strings are passed over.
bool json_nests_within(std::string_view text, std::uint32_t maximum = kDeepestText);

}  // namespace lamina
