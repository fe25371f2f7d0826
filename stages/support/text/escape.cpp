#include "stages/support/text/escape.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

namespace lamina {
namespace {

/// The text with a backslash before each of some characters.
std::string with_backslashes(std::string_view text, std::string_view special) {
  std::string out;
  for (const char c : text) {
    if (special.find(c) != std::string_view::npos) out += '\\';
    out += c;
  }
  return out;
}

int hexadecimal(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

std::string decoded(std::string_view name) {
  std::string out;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const int high = name[i] == '%' && i + 2 < name.size() ? hexadecimal(name[i + 1]) : -1;
    const int low = high >= 0 ? hexadecimal(name[i + 2]) : -1;
    char c = name[i];
    if (low >= 0) c = static_cast<char>(16 * high + low), i += 2;
    out += c == '\\' ? '/' : c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return out;
}

}  // namespace

std::string roff(std::string_view text) {
  std::string out;
  bool line_begins = true;
  for (const char c : text) {
    if (line_begins && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
    line_begins = c == '\n';
  }
  return out;
}

std::string markdown_cell(std::string_view text) {
  std::string out = with_backslashes(text, "|<*_");
  for (char& c : out) {
    if (c == '\n') c = ' ';
  }
  return out;
}

std::string markdown_code(std::string_view text) { return "`" + with_backslashes(text, "|") + "`"; }

std::string zsh_argument(std::string_view text) {
  std::string out;
  for (const char c : with_backslashes(text, "[]:\\")) c == '\'' ? out.append("'\\''") : out.append(1, c);
  return out;
}

std::string fish_word(std::string_view text) { return "'" + with_backslashes(text, "\\'") + "'"; }

std::string base64(std::span<const std::byte> bytes) {
  constexpr char kBase64Digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t have = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < have ? static_cast<std::uint32_t>(bytes[i + k]) : 0);
    for (std::size_t k = 0; k < 4; ++k) text += k <= have ? kBase64Digits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string part_name(std::string_view name, std::string_view folder) {
  std::string whole = decoded(name);
  if (!whole.starts_with('/')) whole.insert(0, folder);
  std::vector<std::string_view> folders;
  const std::string_view text = whole;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find('/', at), text.size());
    const std::string_view one = text.substr(at, end - at);
    if (one == ".." && !folders.empty()) folders.pop_back();
    if (!one.empty() && one != "." && one != "..") folders.push_back(one);
    at = end + 1;
  }
  std::string out;
  for (const std::string_view one : folders) (out += '/') += one;
  return out;
}

Result<std::vector<std::string>> split_words(std::string_view line) {
  std::vector<std::string> words;
  std::string word;
  bool within = false;
  char quote = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    const bool blank = c == ' ' || c == '\t' || c == '\r' || c == '\n';
    if (quote != 0) {
      if (c == quote) {
        quote = 0;
      } else if (c == '\\' && quote == '"' && i + 1 < line.size()) {
        word += line[++i];
      } else {
        word += c;
      }
    } else if (blank) {
      if (within) words.push_back(std::move(word));
      word.clear();
      within = false;
    } else if (c == '#' && !within) {
      break;
    } else {
      within = true;
      if (c == '\'' || c == '"') {
        quote = c;
      } else if (c == '\\' && i + 1 < line.size()) {
        word += line[++i];
      } else {
        word += c;
      }
    }
  }
  if (quote != 0) return Error{Fault::kUsage, fmt::format("a {} is not closed", quote)};
  if (within) words.push_back(std::move(word));
  return words;
}

}  // namespace lamina
