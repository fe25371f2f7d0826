#include "pipeline/cli/help/help.h"

#include <fmt/format.h>

#include <string_view>

#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

std::string flags_of(const CommandSpec& spec, bool with_value_only) {
  std::string text;
  for (const OptionSpec& option : spec.options) {
    if (with_value_only && option.value.empty()) continue;
    for (const std::string_view flag : split(option.flag, ",")) text += fmt::format("{}{}", text.empty() ? "" : " ", flag);
  }
  return text;
}

}  // namespace

std::string bash_completion() {
  std::string names, cases;
  for (const Command* command : commands()) {
    names += fmt::format("{}{}", names.empty() ? "" : " ", command->name);
    const CommandSpec spec = spec_of(*command);
    cases += fmt::format("    {}) options=\"{} --help\"; valued=\" {} \" ;;\n", command->name, flags_of(spec, false),
                         flags_of(spec, true));
  }
  return fmt::format(R"(# bash completion for lamina, made by: lamina completion bash
_lamina() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}} options= valued=
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W "{} --help --version" -- "$word")
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

}  // namespace lamina::pipeline
