#include "stages/load/text.h"

#include <fmt/core.h>

#include "stages/load/threemf/extensions.h"
#include "stages/load/threemf/model.h"

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

std::string quoted(std::string_view word) {
  std::string text = "'";
  for (const char c : word.substr(0, 24)) text += (c >= ' ' && c <= '~') ? c : '?';
  return text + (word.size() > 24 ? "...'" : "'");
}

std::string not_a_number(std::string_view word) {
  std::string with_point(word);
  const std::size_t comma = with_point.find(',');
  double ignored = 0;
  const auto is_digit = [&](std::size_t at) { return at < word.size() && word[at] >= '0' && word[at] <= '9'; };
  if (comma == with_point.npos || !is_digit(comma + 1)) return quoted(word) + " is not a number";
  with_point[comma] = '.';
  if (!parse_number(with_point, ignored)) return quoted(word) + " is not a number";
  return quoted(word) + " has a decimal comma; export it again with decimal points";
}

std::string extension_label(std::string_view space) {
  const std::string_view name = extension_of(space).name;
  return name.empty() ? std::string(space) : fmt::format("{} ({})", name, space);
}

std::string label(const ModelPackage& package, const ModelObject& object) {
  std::string text = fmt::format("object {}", object.id);
  if (!object.name.empty()) text += fmt::format(" \"{}\"", object.name);
  return object.file == 0 ? text : fmt::format("{} in {}", text, package.files[object.file].name.substr(1));
}

}  // namespace lamina::load
