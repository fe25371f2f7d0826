#include "stages/support/text/text_shape.h"

#include <fmt/format.h>

#include <algorithm>

namespace lamina {
namespace {

/// Where a string that begins at `at` ends, one behind its quotes. An unclosed string of one line ends with the line,
/// where the parser stops too.
std::size_t end_of_string(std::string_view text, std::size_t at) {
  const char quote = text[at];
  const bool escapes = quote == '"';
  const std::string_view three = escapes ? R"(""")" : "'''";
  const bool several_lines = text.substr(at, 3) == three;
  for (at += several_lines ? 3 : 1; at < text.size(); ++at) {
    if (escapes && text[at] == '\\') {
      ++at;
    } else if (!several_lines && (text[at] == quote || text[at] == '\n')) {
      return at + (text[at] == quote ? 1 : 0);
    } else if (several_lines && text.substr(at, 3) == three) {
      at += 3;
      for (int more = 0; more < 2 && at < text.size() && text[at] == quote; ++more) ++at;  // quotes at the string's end
      return at;
    }
  }
  return text.size();
}

}  // namespace

BeyondBound toml_beyond_bounds(std::string_view text) {
  std::uint32_t depth = 0, dots = 0, values = 0, line = 1;
  std::size_t line_start = 0;
  for (std::size_t at = 0; at < text.size();) {
    const auto beyond = [&](std::string what) {
      return BeyondBound{std::move(what), line, static_cast<std::uint32_t>(at - line_start + 1)};
    };
    const char c = text[at];
    if (c == '"' || c == '\'') {
      const std::size_t end = end_of_string(text, at);
      for (; at < end; ++at) {
        if (text[at] != '\n') continue;
        ++line;
        line_start = at + 1;
      }
      continue;
    }
    if (c == '#') {
      at = std::min(text.find('\n', at), text.size());
      continue;
    }
    if (c == '.' && ++dots >= kMostKeyParts) return beyond(fmt::format("a key of more than {} parts", kMostKeyParts));
    if (c == ',' || c == '=' || c == '[' || c == ']' || c == '{' || c == '}' || c == '\n') dots = 0;
    if ((c == '[' || c == '{') && ++depth > kDeepestText) return beyond(fmt::format("more than {} levels", kDeepestText));
    if ((c == ']' || c == '}') && depth > 0) --depth;
    // A list has a value for each comma, an assignment or a header begins one.
    if ((c == ',' || c == '=' || c == '[') && ++values > kMostValues) {
      return beyond(fmt::format("more than {} values", kMostValues));
    }
    if (c == '\n') {
      ++line;
      line_start = at + 1;
    }
    ++at;
  }
  return {};
}

bool json_nests_within(std::string_view text, std::uint32_t most) {
  std::uint32_t depth = 0;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (c == '"') {
      for (++at; at < text.size() && text[at] != '"'; ++at) {
        if (text[at] == '\\') ++at;
      }
    } else if (c == '[' || c == '{') {
      if (++depth > most) return false;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return true;
}

}  // namespace lamina
