#include "pipeline/cli/help/help.h"

#include <fmt/format.h>

#include <string_view>

#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

/// Text within [...] of an argument of _arguments, within single quotes.
std::string zsh_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
      continue;
    }
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

}  // namespace

std::string zsh_completion() {
  std::string names, cases;
  for (const Command* command : commands()) {
    names += fmt::format("    '{}:{}'\n", command->name, zsh_text(command->summary));
    cases += fmt::format("    {})\n      _arguments", command->name);
    for (const OptionSpec& option : spec_of(*command).options) {
      for (const std::string_view flag : split(option.flag, ",")) {
        const std::string value = option.value.empty() ? "" : fmt::format(":{}:_files", zsh_text(option.value));
        cases += fmt::format(" \\\n        '*{}[{}]{}'", flag, zsh_text(option.meaning), value);
      }
    }
    cases += " \\\n        '*:file:_files' ;;\n";
  }
  return fmt::format(R"(#compdef lamina
# zsh completion for lamina, made by: lamina completion zsh
_lamina() {{
  local -a names=(
{}  )
  if ((CURRENT == 2)); then
    _describe command names
    return
  fi
  local name=$words[2]
  shift words
  ((CURRENT--))
  case $name in
{}  esac
}}
_lamina "$@"
)",
                     names, cases);
}

}  // namespace lamina::pipeline
