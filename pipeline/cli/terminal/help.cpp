// The help of a command, wrapped to the terminal.
#include <fmt/format.h>

#include <algorithm>

#include "pipeline/cli/terminal/arguments.h"
#include "stages/support/text/number_text.h"

namespace lamina::pipeline {
namespace {

constexpr std::size_t kMeaningColumn = 28;
constexpr char kNoBreak = '\1';  // a blank at which no line ends

/// Appends words in lines of `columns`; the text stands in column `at`, and following lines begin at `indent`.
void wrap(std::string_view words, std::size_t indent, std::size_t columns, std::size_t at, std::string& text) {
  for (std::string_view line = words; !line.empty();) {
    const std::size_t end = std::min(line.find_first_of(" \n"), line.size());
    const std::string_view word = line.substr(0, end);
    line.remove_prefix(std::min(end + 1, line.size()));
    if (word.empty()) continue;
    if (at > indent && at + 1 + word.size() > columns) {
      text += "\n" + std::string(indent, ' ');
      at = indent;
    } else if (at > indent) {
      text += ' ';
      ++at;
    }
    text += word;
    std::ranges::replace(text.end() - static_cast<std::ptrdiff_t>(word.size()), text.end(), kNoBreak, ' ');
    at += word.size();
  }
  text += '\n';
}

/// A term, and its meaning beside it or, where the term is too long, below it.
void add_entry(const std::string& term, const std::string& meaning, std::size_t columns, std::string& text) {
  const std::size_t indent = columns < 2 * kMeaningColumn ? 6 : kMeaningColumn;
  text += "  " + term;
  if (term.size() + 4 > indent) {
    text += "\n" + std::string(indent, ' ');
  } else {
    text += std::string(indent - term.size() - 2, ' ');
  }
  wrap(meaning, indent, columns, indent, text);
}

std::string meaning_of(const OptionSpec& option) {
  return option.preset.empty() ? option.meaning : fmt::format("{} (default{}{})", option.meaning, kNoBreak, option.preset);
}

}  // namespace

std::string help_text(const CommandSpec& spec, int columns) {
  const auto width = static_cast<std::size_t>(std::max(columns, 20));
  std::string text;
  wrap(spec.summary, 0, width, 0, text);
  text += fmt::format("\nUsage: lamina {} [OPTIONS]{}\n", spec.name,
                      spec.operand.empty() ? "" : fmt::format(" [{}...]", spec.operand));
  if (!spec.operand.empty()) {
    text += '\n';
    add_entry(spec.operand, spec.operand_meaning, width, text);
  }
  text += "\nOptions:\n";
  add_entry("-h, --help", "this text", width, text);
  std::string_view group;
  for (const OptionSpec& option : spec.options) {
    if (option.group != group) text += fmt::format("\n{}:\n", option.group);
    group = option.group;
    const std::string flags = fmt::format("{}", fmt::join(split(option.flag, ","), ", "));
    add_entry(option.value.empty() ? flags : flags + " " + option.value, meaning_of(option), width, text);
  }
  if (const std::string end = spec.end(); !end.empty()) text += "\n" + end + "\n";
  return text;
}

}  // namespace lamina::pipeline
