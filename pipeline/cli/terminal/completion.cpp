// Completion scripts for shells: one traversal of commands and options per shell language.
#include "pipeline/cli/terminal/completion.h"

#include <fmt/format.h>

#include <string_view>

#include "stages/support/text/escape.h"
#include "stages/support/text/number_text.h"

namespace lamina::pipeline {
namespace {

constexpr std::string_view kAnyFile = "*", kDirectory = "/";

/// The files that a value names, by the placeholder in the help or by the option; directories lead to them and fit always.
struct FileKind {
  std::string_view name, endings;  // endings: blanks between them, or one of the two above
};
constexpr FileKind kByFlag[] = {{"--job", "toml"},     {"--save-job", "toml"},       {"--machine", "toml"},
                                {"--check", "toml"},   {"--show", "toml"},           {"--plot", "svg png"},
                                {"--measured", "csv"}, {"--parts", "stl obj 3mf gz"}};
constexpr FileKind kByValue[] = {{"PART", "stl obj 3mf gz"},   {"STL", "stl"},        {"DIR", kDirectory},
                                 {"OUT", kDirectory},          {"PNG", "png svg"},    {"HTML", "html"},
                                 {"DIR|GCODE", "gcode gco g"}, {"FILE", kAnyFile},    {"DIR|FILE", kAnyFile},
                                 {"LIST", kAnyFile},           {"NAME|FILE", "toml"}, {"DIR|GCODE|SML", "gcode gco g sml"}};

std::string_view find(std::span<const FileKind> kinds, std::string_view name) {
  for (const FileKind& kind : kinds) {
    if (kind.name == name) return kind.endings;
  }
  return {};
}

/// "" for values that are no files.
std::string_view files_of(const OptionSpec& option) {
  for (const std::string_view flag : split(option.flag, ",")) {
    if (const std::string_view endings = find(kByFlag, flag); !endings.empty()) return endings;
  }
  return find(kByValue, option.value);
}

std::string joined(std::span<const std::string_view> words) { return fmt::format("{}", fmt::join(words, " ")); }

// --- bash

/// The lines of a `case` that set the words and files of each option's values.
std::string bash_values(const CommandSpec& command) {
  std::string text;
  for (const OptionSpec& option : command.options) {
    const std::string_view files = files_of(option);
    if (option.value.empty() || (option.words.empty() && files.empty())) continue;
    text += fmt::format("        {}) words=\"{}\"; files=\"{}\" ;;\n", fmt::join(split(option.flag, ","), "|"),
                        joined(option.words), files);
  }
  return text;
}

// --- zsh

/// The action of _arguments that completes words, files, both or nothing.
std::string zsh_action(std::span<const std::string_view> words, std::string_view files) {
  if (files.empty() || (!words.empty() && files == kAnyFile)) return words.empty() ? " " : fmt::format("({})", joined(words));
  if (files == kDirectory) return "_files -/";
  if (files == kAnyFile) return "_files";
  // The empty ending makes a group of one: without a | zsh takes it as qualifiers.
  const std::string pattern = fmt::format("*.(#i)({}|)", fmt::join(split(files, " "), "|"));
  if (words.empty()) return fmt::format("_files -g \"{}\"", pattern);
  return fmt::format(" _lamina_words_and_files \"{}\" {}", pattern, joined(words));
}

// --- fish

std::string fish_values(std::span<const std::string_view> words, std::string_view files) {
  std::string all = joined(words);
  if (files == kAnyFile) return all.empty() ? " -F" : fmt::format(" -F -a {}", fish_word(all));
  const auto add = [&](const std::string& more) { all += (all.empty() ? "" : " ") + more; };
  if (files == kDirectory) {
    add("(__fish_complete_directories)");
  } else if (!files.empty()) {
    add(fmt::format("(__lamina_files {})", files));
  }
  return all.empty() ? " -f" : fmt::format(" -f -k -a {}", fish_word(all));
}

}  // namespace

std::string bash_completion(std::span<const CommandSpec> commands) {
  std::string names, cases;
  for (const CommandSpec& command : commands) {
    names += fmt::format("{} ", command.name);
    std::string flags, valued;
    for (const OptionSpec& option : command.options) {
      const std::string words = fmt::format("{} ", fmt::join(split(option.flag, ","), " "));
      flags += words;
      if (!option.value.empty()) valued += words;
    }
    if (valued.empty()) valued = " ";
    cases += fmt::format("    {})\n      options=\"{}--help\"; valued=\" {}\"; operands=\"{}\"; operand_files=\"{}\"\n",
                         command.name, flags.empty() ? " " : flags, valued, joined(command.operand_words),
                         find(kByValue, command.operand));
    const std::string values = bash_values(command);
    cases += values.empty() ? "      ;;\n" : fmt::format("      case $before in\n{}      esac ;;\n", values);
  }
  return fmt::format(R"(# bash completion for lamina, made by: lamina completion bash
_lamina_files() {{
  local name real end
  while IFS= read -r name; do
    real=${{name/#\~\//$HOME/}} end=${{name##*.}}
    if [[ $2 == '*' || -d $real || " $2 " == *" ${{end,,}} "* ]]; then COMPREPLY+=("$name"); fi
  done < <(compgen -f -- "$1")
}}
_lamina() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}}
  local options= valued= operands= operand_files= words= files=
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W "{}--help --version" -- "$word")
    return
  fi
  # --option=value is three words.
  if [[ $word == '=' ]]; then word=; elif [[ $before == '=' ]]; then before=${{COMP_WORDS[COMP_CWORD - 2]}}; fi
  case ${{COMP_WORDS[1]}} in
{}  esac
  if [[ $valued != *" $before "* ]]; then
    words=$operands files=$operand_files
    if [[ $word == -* ]]; then words=$options files=; fi
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
  if [[ -n $files ]]; then _lamina_files "$word" "$files"; fi
}}
complete -o filenames -F _lamina lamina
)",
                     names, cases);
}

std::string zsh_completion(std::span<const CommandSpec> commands) {
  std::string names, cases;
  for (const CommandSpec& command : commands) {
    names += fmt::format("    '{}:{}'\n", command.name, zsh_argument(command.brief));
    cases += fmt::format("    {})\n      _arguments", command.name);
    for (const OptionSpec& option : command.options) {
      const std::string value =
          option.value.empty() ? ""
                               : fmt::format(":{}:{}", zsh_argument(option.value), zsh_action(option.words, files_of(option)));
      for (const std::string_view flag : split(option.flag, ",")) {
        // With = the value may be the next word or follow the option in its own.
        const std::string_view equals = !value.empty() && flag.starts_with("--") ? "=" : "";
        cases += fmt::format(" \\\n        '*{}{}[{}]{}'", flag, equals, zsh_argument(option.meaning), value);
      }
    }
    if (!command.operand.empty()) {
      cases += fmt::format(" \\\n        '*:{}:{}'", zsh_argument(command.operand),
                           zsh_action(command.operand_words, find(kByValue, command.operand)));
    }
    cases += " ;;\n";
  }
  return fmt::format(R"(#compdef lamina
# zsh completion for lamina, made by: lamina completion zsh
_lamina_words_and_files() {{
  local pattern=$1
  shift
  compadd -- "$@"
  _files -g "$pattern"
}}
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

std::string fish_completion(std::span<const CommandSpec> commands) {
  std::string script = R"(# fish completion for lamina, made by: lamina completion fish
function __lamina_files
  set -l endings (string join '|' -- $argv)
  __fish_complete_path (string replace -r '^-[^=]*=' '' -- (commandline -ct)) | string match -ri "^[^\t]*(?:/|\.(?:$endings))(?:\t.*)?\$"
end
)";
  for (const CommandSpec& command : commands) {
    script +=
        fmt::format("complete -c lamina -n __fish_use_subcommand -f -a {} -d {}\n", command.name, fish_word(command.brief));
    const std::string detected = fmt::format("complete -c lamina -n '__fish_seen_subcommand_from {}'", command.name);
    script += detected + fish_values(command.operand_words, find(kByValue, command.operand)) + "\n";
    for (const OptionSpec& option : command.options) {
      script += detected;
      for (const std::string_view flag : split(option.flag, ",")) {
        script += flag.starts_with("--") ? fmt::format(" -l {}", flag.substr(2)) : fmt::format(" -s {}", flag.substr(1));
      }
      if (!option.value.empty()) script += " -r" + fish_values(option.words, files_of(option));
      script += fmt::format(" -d {}\n", fish_word(option.meaning));
    }
  }
  return script;
}

}  // namespace lamina::pipeline
