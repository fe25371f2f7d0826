// pipeline/text/readable.h: sizes, times and counts as people read them.
#pragma once

#include <cstdint>
#include <string>

namespace lamina::pipeline {

std::string readable_bytes(std::uint64_t bytes);  // 1.50 GB (powers of 1000)
std::string readable_seconds(double seconds);     // 0.123 s, 12.3 s, 3 min 20 s, 2 h 05 min
std::string readable_count(std::uint64_t count);  // 1 234 567

}  // namespace lamina::pipeline
