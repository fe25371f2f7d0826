// Manual pages and shell completion, made from the definitions that the commands read their arguments by.
#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/markdown_page.h"
#include "pipeline/text/names.h"
#include "pipeline/text/number_text.h"
#include "pipeline/text/version.h"
#include "stages/write/atomic_file.h"

namespace lamina::pipeline {
namespace {

std::string replaced(std::string_view text, char what, std::string_view by) {
  std::string out;
  for (const char c : text) c == what ? out.append(by) : out.append(1, c);
  return out;
}

std::string flags_of(const CommandSpec& spec, bool with_value_only) {
  std::string text;
  for (const OptionSpec& option : spec.options) {
    if (with_value_only && option.value.empty()) continue;
    for (const std::string_view flag : split(option.flag, ",")) text += fmt::format("{}{}", text.empty() ? "" : " ", flag);
  }
  return text;
}

// --- bash

std::string bash_completion() {
  std::string names, cases;
  for (const Command& command : commands()) {
    names += fmt::format("{}{}", names.empty() ? "" : " ", command.name);
    const CommandSpec spec = spec_of(command);
    cases += fmt::format("    {}) options=\"{} --help\"; valued=\" {} \" ;;\n", command.name, flags_of(spec, false),
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

// --- zsh

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

std::string zsh_completion() {
  std::string names, cases;
  for (const Command& command : commands()) {
    names += fmt::format("    '{}:{}'\n", command.name, zsh_text(command.summary));
    cases += fmt::format("    {})\n      _arguments", command.name);
    for (const OptionSpec& option : spec_of(command).options) {
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

// --- fish

std::string fish_completion() {
  const auto quoted = [](std::string_view text) { return "'" + replaced(replaced(text, '\\', "\\\\"), '\'', "\\'") + "'"; };
  std::string text = "# fish completion for lamina, made by: lamina completion fish\n";
  for (const Command& command : commands()) {
    text += fmt::format("complete -c lamina -n __fish_use_subcommand -f -a {} -d {}\n", command.name, quoted(command.summary));
    for (const OptionSpec& option : spec_of(command).options) {
      text += fmt::format("complete -c lamina -n '__fish_seen_subcommand_from {}'", command.name);
      for (const std::string_view flag : split(option.flag, ",")) {
        text += flag.starts_with("--") ? fmt::format(" -l {}", flag.substr(2)) : fmt::format(" -s {}", flag.substr(1));
      }
      text += fmt::format("{} -d {}\n", option.value.empty() ? "" : " -r", quoted(option.meaning));
    }
  }
  return text;
}

// --- man

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

std::string exit_status() {
  return ".SH EXIT STATUS\n0 done, 1 internal error, 2 wrong option or job, 3 bad part file, 4 output could not be written, "
         "5 verification failed, 130 interrupted.\n";
}

std::string title(std::string_view name) {
  std::string upper(name);
  std::ranges::transform(upper, upper.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return fmt::format(".TH {} 1 \"\" \"lamina {}\" \"User Commands\"\n", roff(upper), version());
}

std::string program_page() {
  std::string text =
      title("lamina") +
      ".SH NAME\nlamina \\- plans additive\\-manufacturing jobs\n.SH SYNOPSIS\n.B lamina\n.I COMMAND\n[OPTIONS] ...\n"
      ".SH DESCRIPTION\nMeshes go in; what a machine needs for every layer comes out. Each command has a page of its "
      "own.\n.SH COMMANDS\n";
  std::string also;
  for (const Command& command : commands()) {
    text += fmt::format(".TP\n.B {}\n{}\n", roff(command.name), roff(command.summary));
    also += fmt::format("{}.BR lamina\\-{} (1)", also.empty() ? "" : ",\n", command.name);
  }
  return text + ".SH OPTIONS\n.TP\n.BR \\-h ,\\  \\-\\-help\nwhat there is\n.TP\n.B \\-\\-version\nthe version\n" +
         exit_status() + ".SH SEE ALSO\n" + also + "\n";
}

std::string command_page(const Command& command) {
  const CommandSpec spec = spec_of(command);
  std::string text = title(fmt::format("lamina-{}", command.name));
  text += fmt::format(".SH NAME\nlamina\\-{} \\- {}\n.SH SYNOPSIS\n.B lamina {}\n[OPTIONS]", command.name,
                      roff(command.summary), command.name);
  if (!spec.operand.empty()) text += fmt::format("\n.IR {} \\ ...", roff(spec.operand));
  text += fmt::format("\n.SH DESCRIPTION\n{}\n", roff(spec.summary));
  if (!spec.operand.empty()) text += fmt::format(".TP\n.I {}\n{}\n", roff(spec.operand), roff(spec.operand_meaning));
  text += ".SH OPTIONS\n";
  std::string group;
  for (const OptionSpec& option : spec.options) {
    if (option.group != group && !option.group.empty()) text += fmt::format(".SS {}\n", roff(option.group));
    group = option.group;
    std::string flags = roff(option.flag);
    for (std::size_t at = flags.find(','); at != std::string::npos; at = flags.find(',', at + 2)) flags.insert(at + 1, " ");
    text += fmt::format(".TP\n\\fB{}\\fR{}\n{}", flags, option.value.empty() ? "" : " \\fI" + roff(option.value) + "\\fR",
                        roff(option.meaning));
    text += option.preset.empty() ? "\n" : fmt::format(" (default {})\n", roff(option.preset));
  }
  if (!spec.closing.empty()) text += fmt::format(".SH NOTES\n.nf\n{}\n.fi\n", roff(spec.closing));
  return text + exit_status() + ".SH SEE ALSO\n.BR lamina (1)\n";
}

int show(const std::string& text) {
  const Status status = print(text);
  return status ? 0 : fail(status.error());
}

int write_pages(const std::string& directory, bool markdown) {
  const auto write = [&](const std::string& name, const std::string& page) {
    return write::write_file(fmt::format("{}/{}", directory, name), std::as_bytes(std::span(page)));
  };
  if (!markdown) {
    if (Status status = write("lamina.1", program_page()); !status) return fail(status.error());
  }
  for (const Command& command : commands()) {
    const Status status = markdown ? write(fmt::format("{}.md", command.name), markdown_page(command))
                                   : write(fmt::format("lamina-{}.1", command.name), command_page(command));
    if (!status) return fail(status.error());
  }
  return 0;
}

CommandSpec completion_spec() {
  CommandSpec spec;
  spec.name = "completion";
  spec.summary = "Prints what makes a shell complete the commands and options of lamina; packages install it already.";
  spec.operand = "SHELL";
  spec.operand_meaning = "bash, zsh or fish";
  spec.closing =
      "Examples:\n"
      "  lamina completion bash > ~/.local/share/bash-completion/completions/lamina\n"
      "  lamina completion zsh > ~/.zfunc/_lamina\n"
      "  lamina completion fish > ~/.config/fish/completions/lamina.fish";
  return spec;
}

CommandSpec manual_spec() {
  CommandSpec spec;
  spec.name = "manual";
  spec.summary = "Prints the manual page of lamina, or of one of its commands, as man reads it.";
  spec.operand = "COMMAND";
  spec.operand_meaning = "a command; none for the page of the program";
  spec.options = {{"-o,--output", "DIR", "write all pages into a directory instead, as packages do", "", ""},
                  {"--markdown", "", "pages of commands as Markdown: docs/commands is made by this", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina manual jet | man -l -\n"
      "  lamina manual --markdown -o docs/commands";
  return spec;
}

}  // namespace

int run_completion_command(const std::vector<std::string>& texts) {
  const Result<Arguments> arguments = read_arguments(completion_spec(), texts);
  if (!arguments) return fail(arguments.error());
  if (arguments->help) return show(*arguments->help);
  const std::string shell = arguments->operands.size() == 1 ? arguments->operands.front() : "";
  if (shell == "bash") return show(bash_completion());
  if (shell == "zsh") return show(zsh_completion());
  if (shell == "fish") return show(fish_completion());
  return fail({Fault::kUsage, "name one shell: bash, zsh or fish"});
}

int run_manual_command(const std::vector<std::string>& texts) {
  const Result<Arguments> arguments = read_arguments(manual_spec(), texts);
  if (!arguments) return fail(arguments.error());
  if (arguments->help) return show(*arguments->help);
  const bool markdown = arguments->has("--markdown");
  if (arguments->has("-o,--output")) return write_pages(arguments->text("-o,--output"), markdown);
  if (arguments->operands.empty()) {
    return markdown ? fail({Fault::kUsage, "--markdown: name a command, or -o DIR for all of them"}) : show(program_page());
  }
  if (arguments->operands.size() == 1) {
    if (const Command* command = find_command(arguments->operands.front()))
      return show(markdown ? markdown_page(*command) : command_page(*command));
  }
  std::vector<std::string_view> names;
  for (const Command& command : commands()) names.push_back(command.name);
  return fail({Fault::kUsage, fmt::format("'{}' is no command{}; lamina --help lists them", arguments->operands.front(),
                                          suggest(arguments->operands.front(), names))});
}

}  // namespace lamina::pipeline
