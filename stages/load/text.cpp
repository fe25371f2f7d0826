// stages/load/text.cpp: where a byte of a text file is, in a person's terms.
#include "stages/load/text.h"

namespace lamina::load {

std::uint64_t line_of(const Source& source, std::uint64_t offset) {
  Buffer<char> text(std::size_t{1} << 20);
  std::uint64_t line = 1, at = 0;
  char before = 0;
  while (at < offset) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(text.size(), offset - at));
    if (!source.read(at, text.data(), count)) break;
    for (std::size_t i = 0; i < count; ++i) {
      const char c = text[i];
      if (c == '\r' || (c == '\n' && before != '\r')) ++line;
      before = c;
    }
    at += count;
  }
  return line;
}

}  // namespace lamina::load
