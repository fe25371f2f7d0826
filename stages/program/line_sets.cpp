#include "stages/program/line_sets.h"

namespace lamina::program {

void combine(Line one, Line other, LineOperation operation, Buffer<std::uint32_t>& result) {
  std::size_t i = 0, j = 0;
  bool before = false;
  while (i < one.size() || j < other.size()) {
    const std::uint32_t a = i < one.size() ? one[i] : UINT32_MAX, b = j < other.size() ? other[j] : UINT32_MAX;
    const std::uint32_t at = a < b ? a : b;
    i += a == at;
    j += b == at;
    const bool in_one = i % 2 == 1, in_other = j % 2 == 1;
    const bool inside = operation == LineOperation::kUnion ? in_one || in_other : in_one && !in_other;
    if (inside != before) result.push_back(at);
    before = inside;
  }
}

std::uint64_t pixels_of(Line line) {
  std::uint64_t pixels = 0;
  for (std::size_t i = 0; i + 1 < line.size(); i += 2) pixels += line[i + 1] - line[i];
  return pixels;
}

void divide(Line line, std::uint64_t number, std::uint32_t share, bool upper, Buffer<std::uint32_t>& result) {
  for (std::size_t i = 0; i + 1 < line.size(); i += 2) {
    bool before = false;
    for (std::uint32_t place = line[i]; place < line[i + 1]; ++place) {
      const bool fires = upper_fires(number, place, share) == upper;
      if (fires != before) result.push_back(place);
      before = fires;
    }
    if (before) result.push_back(line[i + 1]);
  }
}

}  // namespace lamina::program
