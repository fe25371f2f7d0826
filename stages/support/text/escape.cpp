#include "stages/support/text/escape.h"

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

}  // namespace lamina
