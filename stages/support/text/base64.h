// stages/support/text/base64.h: bytes as text.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace lamina {

/// Base 64 as in RFC 4648, padded, without line ends.
std::string base64(std::span<const std::byte> bytes);

}  // namespace lamina
