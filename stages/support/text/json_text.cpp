#include "stages/support/text/json_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

namespace lamina {
namespace {

// Bytes of the UTF-8 character at the front of `text`; 0 if there is none (RFC 3629: no surrogates, no overlong forms).
std::size_t character_bytes(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(0);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >= 0xc2 && lead < 0xe0 ? 2 : (lead & 0xf0) == 0xe0 ? 3 : lead >= 0xf0 && lead < 0xf5 ? 4 : 0;
  if (length == 0 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  const bool overlong = (lead == 0xe0 && byte(1) < 0xa0) || (lead == 0xf0 && byte(1) < 0x90);
  const bool surrogate = lead == 0xed && byte(1) >= 0xa0;
  const bool beyond = lead == 0xf4 && byte(1) >= 0x90;
  return overlong || surrogate || beyond ? 0 : length;
}

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

std::string json_string(std::string_view text) {
  std::string out = "\"";
  while (!text.empty()) {
    const std::size_t length = character_bytes(text);
    const char c = text.front();
    if (length == 0) {
      out += "\xef\xbf\xbd";  // U+FFFD, so that what is read back is written the same
    } else if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (c == '\n') {
      out += "\\n";
    } else if (static_cast<std::uint8_t>(c) < 0x20 || c == 0x7f) {
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      out += text.substr(0, length);
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return out + '"';
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = character_bytes(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

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
    if (c == '.' && ++dots >= kMaxKeyParts) return beyond(fmt::format("a key of more than {} parts", kMaxKeyParts));
    if (c == ',' || c == '=' || c == '[' || c == ']' || c == '{' || c == '}' || c == '\n') dots = 0;
    if ((c == '[' || c == '{') && ++depth > kDeepestText) return beyond(fmt::format("more than {} levels", kDeepestText));
    if ((c == ']' || c == '}') && depth > 0) --depth;
    // A list has a value for each comma, an assignment or a header begins one.
    if ((c == ',' || c == '=' || c == '[') && ++values > kMaxValues) {
      return beyond(fmt::format("more than {} values", kMaxValues));
    }
    if (c == '\n') {
      ++line;
      line_start = at + 1;
    }
    ++at;
  }
  return {};
}

bool json_nests_within(std::string_view text, std::uint32_t maximum) {
  std::uint32_t depth = 0;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (c == '"') {
      for (++at; at < text.size() && text[at] != '"'; ++at) {
        if (text[at] == '\\') ++at;
      }
    } else if (c == '[' || c == '{') {
      if (++depth > maximum) return false;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return true;
}

}  // namespace lamina
