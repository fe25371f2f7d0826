// Completion scripts for shells: one traversal of commands and options per shell language.
#include <fmt/format.h>

#include <string_view>

#include "pipeline/cli/help/help.h"
#include "stages/data/text/escape.h"
#include "stages/data/text/number_text.h"

namespace lamina::pipeline {

std::string bash_completion() {
  std::string names, cases;
  for (const Command* command : commands()) {
    names += fmt::format("{} ", command->name);
    std::string flags, valued;
    for (const OptionSpec& option : spec_of(*command).options) {
      const std::string words = fmt::format("{} ", fmt::join(split(option.flag, ","), " "));
      flags += words;
      if (!option.value.empty()) valued += words;
    }
    if (valued.empty()) valued = " ";
    cases +=
        fmt::format("    {}) options=\"{}--help\"; valued=\" {}\" ;;\n", command->name, flags.empty() ? " " : flags, valued);
  }
  return fmt::format(R"(# bash completion for lamina, made by: lamina completion bash
_lamina() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}} options= valued=
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W "{}--help --version" -- "$word")
    return
  fi
  case ${{COMP_WORDS[1]}} in
{}  esac
  if [[ $word == -* && $valued != *" $before "* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$word")
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$word")
  fi
}}
complete -o filenames -F _lamina lamina
)",
                     names, cases);
}

std::string zsh_completion() {
  std::string names, cases;
  for (const Command* command : commands()) {
    names += fmt::format("    '{}:{}'\n", command->name, zsh_argument(command->summary));
    cases += fmt::format("    {})\n      _arguments", command->name);
    for (const OptionSpec& option : spec_of(*command).options) {
      const std::string value = option.value.empty() ? "" : fmt::format(":{}:_files", zsh_argument(option.value));
      for (const std::string_view flag : split(option.flag, ",")) {
        cases += fmt::format(" \\\n        '*{}[{}]{}'", flag, zsh_argument(option.meaning), value);
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

std::string fish_completion() {
  std::string script = "# fish completion for lamina, made by: lamina completion fish\n";
  for (const Command* command : commands()) {
    script +=
        fmt::format("complete -c lamina -n __fish_use_subcommand -f -a {} -d {}\n", command->name, fish_word(command->summary));
    for (const OptionSpec& option : spec_of(*command).options) {
      script += fmt::format("complete -c lamina -n '__fish_seen_subcommand_from {}'", command->name);
      for (const std::string_view flag : split(option.flag, ",")) {
        script += flag.starts_with("--") ? fmt::format(" -l {}", flag.substr(2)) : fmt::format(" -s {}", flag.substr(1));
      }
      script += fmt::format("{} -d {}\n", option.value.empty() ? "" : " -r", fish_word(option.meaning));
    }
  }
  return script;
}

}  // namespace lamina::pipeline
