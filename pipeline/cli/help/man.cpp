#include "pipeline/cli/help/help.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>

#include "pipeline/text/version.h"

namespace lamina::pipeline {
namespace {

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

}  // namespace

std::string man_page() {
  std::string text =
      title("lamina") +
      ".SH NAME\nlamina \\- plans additive\\-manufacturing jobs\n.SH SYNOPSIS\n.B lamina\n.I COMMAND\n[OPTIONS] ...\n"
      ".SH DESCRIPTION\nMeshes go in; what a machine needs for every layer comes out. Each command has a page of its "
      "own.\n.SH COMMANDS\n";
  std::string also;
  for (const Command* command : commands()) {
    text += fmt::format(".TP\n.B {}\n{}\n", roff(command->name), roff(command->summary));
    also += fmt::format("{}.BR lamina\\-{} (1)", also.empty() ? "" : ",\n", command->name);
  }
  return text + ".SH OPTIONS\n.TP\n.BR \\-h ,\\  \\-\\-help\nwhat there is\n.TP\n.B \\-\\-version\nthe version\n" +
         exit_status() + ".SH SEE ALSO\n" + also + "\n";
}

std::string man_page(const Command& command) {
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

}  // namespace lamina::pipeline
