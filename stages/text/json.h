// stages/text/json.h: JSON values, their keys in the order in which they are set.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace lamina {

using Json = nlohmann::ordered_json;

/// A value as text that ends with a line's end, on one line or indented; bytes that are not UTF-8 become U+FFFD.
std::string json_line(const Json& value, int indent = -1);

}  // namespace lamina
