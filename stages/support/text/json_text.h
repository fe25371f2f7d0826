// stages/support/text/json_text.h: JSON text without a document tree, for speed.
#pragma once

#include <string>
#include <string_view>

namespace lamina {

/// The text in quotes, escaped for JSON (and for TOML's basic strings); bytes that are not UTF-8 become U+FFFD.
std::string json_string(std::string_view text);

/// Whether the bytes are UTF-8.
bool is_utf8(std::string_view text);

}  // namespace lamina
