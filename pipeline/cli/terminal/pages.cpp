#include "pipeline/cli/terminal/pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

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
     "[concepts](../concepts.md), [what a bitmap means](../bitmap.md), [job files](../job.md), "
     "[print programs](../print_program.md), [formats](../formats.md)"},
    {"slice", "[contours](../slice.md), [filling](../filling.md), [job files](../job.md), [formats](../formats.md)"},
    {"heights", "[layer heights](../heights.md)"},
    {"extrude",
     "[extrusion](../extrude.md), [segmented lines](../segmented.md), [filling](../filling.md), [job files](../job.md)"},
    {"calibrate", "[the procedure](../calibrate.md), [segmented lines](../segmented.md)"},
    {"info", "[concepts](../concepts.md)"},
    {"export", "[concepts](../concepts.md), [formats](../formats.md)"},
    {"verify", "[exactness](../exactness.md), [print programs](../print_program.md)"},
    {"permeability", "[segmented lines](../segmented.md)"},
    {"merge", "[more than one machine](../batch.md#more-than-one-machine)"},
    {"machines", "[machines](../machines.md), [how to add one](../extending.md)"},
    {"preview", "[contours](../slice.md), [print programs](../print_program.md)"},
    {"report", "[what is on the page](../report.md)"},
    {"batch", "[many jobs](../batch.md)"},
    {"completion", "[installing](../install.md)"},
    {"manual", "[installing](../install.md)"},
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
         ".TP\n.I manifest.json\nin the directory of a job, or NAME.json beside a file of toolpaths: the job as it was resolved, and "
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
      "<!-- Made from the definition of the command: lamina manual --markdown -o docs/commands -->\n"
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
  return text + "\nExit codes are those of [every command](../../README.md#use).\n";
}

}  // namespace lamina::pipeline
