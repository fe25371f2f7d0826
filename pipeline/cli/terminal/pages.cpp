#include "pipeline/cli/terminal/pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>

#include "stages/support/text/escape.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

/// Pages of docs/ related to a command.
struct More {
  std::string_view command, pages;
};
constexpr More kMore[] = {
    {"jet",
     "[concepts](../../theory/concepts.md), [what a bitmap means](../../theory/bitmap.md), [job files](../job.md), "
     "[print programs](../print_program.md), [formats](../formats.md)"},
    {"slice", "[contours](../slice.md), [filling](../filling.md), [job files](../job.md), [formats](../formats.md)"},
    {"heights", "[layer heights](../../theory/heights.md)"},
    {"extrude",
     "[extrusion](../extrude.md), [segmented lines](../segmented.md), [filling](../filling.md), [job files](../job.md)"},
    {"calibrate", "[the procedure](../../howto/calibrate.md), [segmented lines](../segmented.md)"},
    {"info", "[concepts](../../theory/concepts.md)"},
    {"export", "[concepts](../../theory/concepts.md), [formats](../formats.md)"},
    {"compare", "[compare photographs](../../howto/compare_photographs.md)"},
    {"convert", "[plan images](../../howto/plan_images.md)"},
    {"design", "[design pores](../../howto/design_pores.md)"},
    {"verify", "[exactness](../../theory/exactness.md), [print programs](../print_program.md)"},
    {"permeability", "[pores and permeability](../../theory/pores.md), [segmented lines](../segmented.md)"},
    {"merge", "[more than one machine](../../howto/run_batches.md#more-than-one-machine)"},
    {"stream", "[print programs](../print_program.md)"},
    {"machines", "[machines](../machines.md), [how to add one](../../../CONTRIBUTING.md)"},
    {"preview", "[contours](../slice.md), [print programs](../print_program.md)"},
    {"report", "[what is on the page](../../howto/read_reports.md)"},
    {"batch", "[many jobs](../../howto/run_batches.md)"},
    {"watch", "[watch a folder](../../howto/run_batches.md#watch-a-folder)"},
    {"completion", "[installing](../../howto/install.md)"},
    {"manual", "[installing](../../howto/install.md)"},
};

std::string sentence(std::string_view text) {
  std::string out(text);
  if (!out.empty()) out.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(out.front())));
  return out + ".";
}

std::string exit_status() {
  return ".SH EXIT STATUS\n0 done, 1 internal error, 2 wrong option or job, 3 bad part file or an empty job, 4 output could not be "
         "written, 5 verification failed or a warning with --strict, 6 out of memory, 130 interrupted.\n";
}

std::string title(std::string_view name) {
  std::string upper(name);
  std::ranges::transform(upper, upper.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return fmt::format(".TH {} 1 \"\" \"lamina {}\" \"User Commands\"\n", roff(upper), version());
}

/// What every page ends with. The variables are those that the program reads.
std::string files_and_environment() {
  return ".SH FILES\n.TP\n.I /usr/share/doc/lamina/docs\nwhere packages install the pages that are named docs/NAME.md here\n"
         ".TP\n.I manifest.json\nin the directory of a job, or NAME.json next to a file of toolpaths: the job as it was resolved, and "
         "the size and hash of every file\n.TP\n.I NAME.part\na file that is being written; it takes its name when it is whole\n"
         ".SH ENVIRONMENT\n.TP\n.B SOURCE_DATE_EPOCH\nseconds since 1970 that date the 3MF files which are written\n";
}

/// "-o, --output".
std::string flags_of(const OptionSpec& option) { return fmt::format("{}", fmt::join(split(option.flag, ","), ", ")); }

}  // namespace

std::string man_page(std::span<const CommandSpec> commands) {
  std::string text =
      title("lamina") +
      ".SH NAME\nlamina \\- plans additive\\-manufacturing jobs\n.SH SYNOPSIS\n.B lamina\n.I COMMAND\n[OPTIONS] ...\n"
      ".SH DESCRIPTION\nMeshes go in; what a machine needs for every layer comes out. Each command has a page of its "
      "own.\n.SH COMMANDS\n";
  std::string also;
  for (const CommandSpec& command : commands) {
    text += fmt::format(".TP\n.B {}\n{}\n", roff(command.name), roff(command.brief));
    also += fmt::format("{}.BR lamina\\-{} (1)", also.empty() ? "" : ",\n", command.name);
  }
  return text + ".SH OPTIONS\n.TP\n.BR \\-h ,\\  \\-\\-help\nwhat there is\n.TP\n.B \\-\\-version\nthe version\n" +
         exit_status() + files_and_environment() + ".SH SEE ALSO\n" + also + "\n";
}

std::string man_page(const CommandSpec& spec) {
  std::string text = title(fmt::format("lamina-{}", spec.name));
  text += fmt::format(".SH NAME\nlamina\\-{} \\- {}\n.SH SYNOPSIS\n.B lamina {}\n[OPTIONS]", spec.name, roff(spec.brief),
                      spec.name);
  if (!spec.operand.empty()) text += fmt::format("\n.IR {} \\ ...", roff(spec.operand));
  text += fmt::format("\n.SH DESCRIPTION\n{}\n", roff(spec.summary));
  if (!spec.operand.empty()) text += fmt::format(".TP\n.I {}\n{}\n", roff(spec.operand), roff(spec.operand_meaning));
  text += ".SH OPTIONS\n";
  std::string group;
  for (const OptionSpec& option : spec.options) {
    if (option.group != group && !option.group.empty()) text += fmt::format(".SS {}\n", roff(option.group));
    group = option.group;
    text += fmt::format(".TP\n\\fB{}\\fR{}\n{}", roff(flags_of(option)),
                        option.value.empty() ? "" : " \\fI" + roff(option.value) + "\\fR", roff(option.meaning));
    text += option.preset.empty() ? "\n" : fmt::format(" (default {})\n", roff(option.preset));
  }
  if (const std::string end = spec.end(); !end.empty()) text += fmt::format(".SH NOTES\n.nf\n{}\n.fi\n", roff(end));
  return text + exit_status() + files_and_environment() + ".SH SEE ALSO\n.BR lamina (1)\n";
}

std::string markdown_page(const CommandSpec& spec) {
  std::string text = fmt::format(
      "<!-- Made from the definition of the command: lamina manual --markdown -o docs/reference/commands -->\n"
      "# lamina {}\n\n{}\n\n",
      spec.name, sentence(spec.brief));
  text += fmt::format("    lamina {} [OPTIONS]{}\n\n{}\n\n", spec.name, spec.operand.empty() ? "" : " " + spec.operand + " ...",
                      spec.summary);
  if (!spec.operand.empty())
    text += fmt::format("{}: {}.\n\n", markdown_code(spec.operand), markdown_cell(spec.operand_meaning));
  std::string group = "-";
  for (const OptionSpec& option : spec.options) {
    if (option.group != group) {
      text += fmt::format("{}## {}\n\n| option | meaning | default |\n|---|---|---|\n", group == "-" ? "" : "\n",
                          option.group.empty() ? "Options" : option.group);
      group = option.group;
    }
    const std::string flags = flags_of(option) + (option.value.empty() ? "" : " " + option.value);
    text += fmt::format("| {} | {} | {} |\n", markdown_code(flags), markdown_cell(option.meaning),
                        option.preset.empty() ? "" : markdown_code(option.preset));
  }
  if (const std::string end = spec.end(); !end.empty())
    text += fmt::format("{}## Notes and examples\n\n```text\n{}\n```\n", spec.options.empty() ? "" : "\n", end);
  for (const More& more : kMore) {
    if (more.command == spec.name) text += fmt::format("\nMore: {}.\n", more.pages);
  }
  return text + "\nExit codes are those of [every command](../../../README.md#commands).\n";
}

// --- completion scripts: one traversal of commands and options per shell language

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
    cases += fmt::format(
        "    {})\n      options=\"{}--help --help-all\"; valued=\" {}\"; operands=\"{}\"; operand_files=\"{}\"\n", command.name,
        flags.empty() ? " " : flags, valued, joined(command.operand_words), find(kByValue, command.operand));
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
