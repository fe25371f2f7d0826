// stages/support/text/json.h: JSON values with keys in insertion order.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace lamina {

using Json = nlohmann::ordered_json;

/// A value as text with a final line end, on one line or indented; bytes that are not UTF-8 become U+FFFD.
std::string json_line(const Json& value, int indent = -1);

}  // namespace lamina
