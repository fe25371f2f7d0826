// stages/support/text/readable.h: human-readable sizes, times, counts and texts from files, and suggestions for mistyped names.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace lamina {

std::string readable_bytes(std::uint64_t bytes);  // 1.50 GB (powers of 1000)
std::string readable_seconds(double seconds);     // 0.123 s, 12.3 s, 3 min 20 s, 2 h 05 min
std::string readable_count(std::uint64_t count);  // 1 234 567

/// The text without line breaks and other control characters, for messages of one line.
std::string one_line(std::string_view text);

/// The text with A to Z as a to z.
std::string lower_case(std::string_view text);

/// "; did you mean 'layer'?" for the known name at the least edit distance, or "" if none is near.
std::string suggest(std::string_view mistyped, std::span<const std::string_view> known);

}  // namespace lamina
