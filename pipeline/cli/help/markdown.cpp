#include "pipeline/cli/help/help.h"

#include <fmt/format.h>

#include <cctype>
#include <string_view>

#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

/// Pages of docs/ that tell more about a command.
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

/// Within a cell of a table.
std::string cell(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '|' || c == '<' || c == '*' || c == '_') out += '\\';
    c == '\n' ? out.append(1, ' ') : out.append(1, c);
  }
  return out;
}

std::string code(std::string_view text) {
  std::string out = "`";
  for (const char c : text) out += c == '|' ? std::string("\\|") : std::string(1, c);
  return out + "`";
}

std::string sentence(std::string_view text) {
  std::string out(text);
  if (!out.empty()) out.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(out.front())));
  return out + ".";
}

}  // namespace

std::string markdown_page(const Command& command) {
  const CommandSpec spec = spec_of(command);
  std::string text = fmt::format(
      "<!-- Made from the definition of the command: lamina manual --markdown -o docs/commands -->\n"
      "# lamina {}\n\n{}\n\n",
      command.name, sentence(command.summary));
  text += fmt::format("    lamina {} [OPTIONS]{}\n\n{}\n\n", command.name,
                      spec.operand.empty() ? "" : " " + spec.operand + " ...", spec.summary);
  if (!spec.operand.empty()) text += fmt::format("{}: {}.\n\n", code(spec.operand), cell(spec.operand_meaning));
  std::string group = "-";
  for (const OptionSpec& option : spec.options) {
    if (option.group != group) {
      text += fmt::format("{}## {}\n\n| option | meaning | default |\n|---|---|---|\n", group == "-" ? "" : "\n",
                          option.group.empty() ? "Options" : option.group);
      group = option.group;
    }
    std::string flags;
    for (const std::string_view flag : split(option.flag, ",")) flags += fmt::format("{}{}", flags.empty() ? "" : ", ", flag);
    if (!option.value.empty()) flags += " " + option.value;
    text +=
        fmt::format("| {} | {} | {} |\n", code(flags), cell(option.meaning), option.preset.empty() ? "" : code(option.preset));
  }
  if (!spec.closing.empty())
    text += fmt::format("{}## Notes and examples\n\n```text\n{}\n```\n", spec.options.empty() ? "" : "\n", spec.closing);
  for (const More& more : kMore) {
    if (more.command == command.name) text += fmt::format("\nMore: {}.\n", more.pages);
  }
  return text + "\nExit codes are those of [every command](../../README.md#use).\n";
}

}  // namespace lamina::pipeline
