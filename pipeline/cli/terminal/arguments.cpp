// Only this file depends on the command line library.
#include "pipeline/cli/terminal/arguments.h"

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <deque>

#include "pipeline/job/errors.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/terminal.h"

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

/// A term, and its meaning next to it or, where the term is too long, below it.
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

void add_option_entry(const OptionSpec& option, std::size_t columns, std::string& text) {
  const std::string flags = fmt::format("{}", fmt::join(split(option.flag, ","), ", "));
  add_entry(option.value.empty() ? flags : flags + " " + option.value, meaning_of(option), columns, text);
}

/// The heading and the first lines of the examples at the end of a help.
std::string first_examples(std::string_view end) {
  constexpr int kLines = 5;
  const std::size_t begin = end.find("Examples:");
  if (begin == std::string_view::npos) return {};
  std::size_t stop = begin;
  for (int line = 0; line <= kLines && stop < end.size(); ++line) stop = std::min(end.find('\n', stop), end.size() - 1) + 1;
  std::string text = "\n" + std::string(end.substr(begin, stop - begin));
  if (!text.ends_with('\n')) text += '\n';
  return text;
}

/// Options of other slicers with the meaning and the values of one of lamina, which are accepted in its place.
constexpr std::string_view kAcceptedAliases[][2] = {{"--layer", "--layer-height"},
                                                    {"--density", "--infill --fill-density --infill-sparse-density"},
                                                    {"--walls", "--perimeters --wall-loops --wall-line-count"},
                                                    {"--top-layers", "--top-solid-layers"},
                                                    {"--bottom-layers", "--bottom-solid-layers"}};

/// An option of lamina, the options of other slicers that it is called there, and what differs.
struct SlicerAlias {
  std::string_view ours, theirs, differs = {};
};
// Of two rows of a word, the first whose option the command has counts. Without an option of ours, lamina has nothing of it.
constexpr SlicerAlias kSlicerAliases[] = {
    {"--line-distance", "--infill-line-distance"},
    {"--pattern", "--fill-pattern --infill-pattern"},
    {"--angle", "--fill-angle --infill-angle --infill-angles"},
    {"--bead", "--extrusion-width --line-width"},
    {"--flow", "--extrusion-multiplier --material-flow"},
    {"--dpi", "--resolution", "pixels per inch"},
    {"--tolerance", "--resolution --meshfix-maximum-deviation --gcode-resolution", "micrometres"},
    {"--bridge", "--slice-closing-radius"},
    {"--nozzle-temperature", "--temperature --material-print-temperature"},
    {"--bed-temperature", "--material-bed-temperature"},
    {"--wall-speed", "--perimeter-speed --speed-wall"},
    {"--print-speed", "--infill-speed --speed-print"},
    {"--travel-speed", "--speed-travel"},
    {"--first-layer-speed", "--speed-layer-0"},
    {"--retraction", "--retract-length --retraction-amount"},
    {"--fan", "--cool-fan-speed --max-fan-speed"},
    {"--relative-extrusion", "--use-relative-e-distances"},
    {"--bed", "--bed-shape", "width and depth, as 250x210"},
    {"--at", "--center", "the corner of the part's box, not its middle"},
    {"--at", "--align-xy"},
    {"--copies", "--duplicate"},
    {"--rotate", "--rotate-x --rotate-y --rotate-z", "three angles, about x, y and z: X,Y,Z"},
    {"--skirt", "--skirts --skirt-line-count"},
    {"--brim", "--brim-width"},
    {"--raft", "--raft-layers"},
    {"--job", "--load"},
    {"--save-job", "--save"},
    {"--machine", "--printer --printer-profile"},
    {"--output", "--output-dir"},
    {"--quiet", "--loglevel"},
    {"", "--support --supports --support-material --support-enable", "lamina makes no supports"},
};

/// The option's names, and those of other slicers that no option of the command has.
std::string with_aliases(const CommandSpec& spec, const std::string& flags) {
  std::string names = flags;
  for (const auto& [ours, theirs] : kAcceptedAliases) {
    if (ours != flags) continue;
    for (const std::string_view name : split(theirs, " "))
      if (spec.find(name) == nullptr) names += fmt::format(",{}", name);
  }
  return names;
}

}  // namespace

const OptionSpec* CommandSpec::find(std::string_view flag) const {
  for (const OptionSpec& option : options) {
    std::string_view flags = option.flag;
    for (std::size_t comma = 0; (comma = flags.find(',')) != flags.npos; flags.remove_prefix(comma + 1)) {
      if (flags.substr(0, comma) == flag) return &option;
    }
    if (flags == flag) return &option;
  }
  return nullptr;
}

Status at_option(std::string_view flag, const std::string& wrong) {
  if (wrong.empty()) return {};
  return usage("{}: {}", flag.substr(flag.rfind(',') + 1), wrong);
}

bool Arguments::has(std::string_view flag) const {
  return std::ranges::any_of(options, [&](const auto& option) { return option.first == flag; });
}

std::vector<std::string> Arguments::all(std::string_view flag) const {
  std::vector<std::string> values;
  for (const auto& [name, value] : options) {
    if (name == flag) values.push_back(value);
  }
  return values;
}

std::string Arguments::text(std::string_view flag) const {
  const auto values = all(flag);
  return values.empty() ? std::string() : values.back();
}

std::string slicer_alias(std::string_view flag, const CommandSpec& spec) {
  std::string word(flag);
  std::ranges::replace(word, '_', '-');
  for (const auto& [ours, theirs] : kAcceptedAliases) {
    const auto words = split(theirs, " ");
    if (std::ranges::find(words, word) != words.end() && spec.find(ours) != nullptr)
      return fmt::format("; did you mean '{}'?", ours);
  }
  for (const SlicerAlias& row : kSlicerAliases) {
    if (const auto words = split(row.theirs, " "); std::ranges::find(words, word) == words.end()) continue;
    if (row.ours.empty()) return fmt::format("; {}", row.differs);
    if (spec.find(row.ours) == nullptr) continue;
    return row.differs.empty() ? fmt::format("; did you mean '{}'?", row.ours)
                               : fmt::format("; did you mean '{}' ({})?", row.ours, row.differs);
  }
  return {};
}

struct ArgumentReader::State {
  CLI::App app;
  std::vector<std::string_view> known = {"--help", "--help-all"};
  std::deque<std::vector<std::string>> values;  // addresses must not change
  std::deque<std::string> names;                // that `known` refers to
  std::vector<CLI::Option*> options;
  std::vector<std::string> operands;
};

ArgumentReader::ArgumentReader(const CommandSpec& spec) : spec_(spec), state_(std::make_unique<State>()) {
  CLI::App& app = state_->app;
  app.name("lamina " + spec.name);
  app.allow_extras();
  app.set_help_all_flag("--help-all");
  for (const OptionSpec& option : spec.options) {
    std::vector<std::string>& texts = state_->values.emplace_back();
    const std::string& flags = state_->names.emplace_back(with_aliases(spec, option.flag));
    state_->options.push_back(
        option.value.empty()
            ? app.add_flag(flags)
            : app.add_option(flags, texts)->type_name(option.value)->expected(1)->allow_extra_args(false)->take_all());
    for (const std::string_view name : split(flags, ",")) state_->known.push_back(name);
  }
  if (!spec.operand.empty()) {  // its name may contain spaces, which CLI11 2.4 refuses
    app.add_option("operands", state_->operands)->type_name("")->expected(0, 1 << 29);
  }
}

ArgumentReader::~ArgumentReader() = default;

Result<Arguments> ArgumentReader::read(const std::vector<std::string>& arguments) {
  const auto wrong = [&](const std::string& what) {
    const std::string line = one_line(what);
    if (line.ends_with('?')) return Error{Fault::kUsage, line};
    return usage("{}; see lamina {} --help", line, spec_.name);
  };
  Arguments read;
  read.given = arguments;
  auto& [app, known, values, names, options, operands] = *state_;
  for (std::vector<std::string>& texts : values) texts.clear();
  operands.clear();
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::CallForHelp&) {
    read.help = help_text(spec_, std::clamp(terminal_columns(), 40, 120), HelpLength::kShort);
    return read;
  } catch (const CLI::CallForAllHelp&) {
    read.help = help_text(spec_, std::clamp(terminal_columns(), 40, 120), HelpLength::kAll);
    return read;
  } catch (const CLI::Error& error) {
    return wrong(error.what());
  }
  read.operands = operands;
  for (const std::string& extra : app.remaining()) {
    if (extra == "--") continue;
    const std::string_view name = std::string_view(extra).substr(0, extra.find('='));
    for (const auto& [flag, why] : spec_.absent) {
      if (name == flag) return wrong(fmt::format("{}: {}", flag, why));
    }
    if (!extra.starts_with('-')) return wrong(fmt::format("'{}': not expected here", extra));
    const std::string hint = slicer_alias(name, spec_);
    return wrong(fmt::format("{}: no such option{}", name, hint.empty() ? suggest(name, known) : hint));
  }
  for (std::size_t i = 0; i < options.size(); ++i) {
    const std::string& flag = spec_.options[i].flag;
    if (spec_.options[i].value.empty()) {
      if (options[i]->count() > 0) read.options.emplace_back(flag, "");
      continue;
    }
    for (std::string& text : values[i]) {
      // -o --resume: an option without its value.
      if (std::ranges::find(known, std::string_view(text)) != known.end()) {
        return wrong(fmt::format("{}: needs a value, {}, before {}", options[i]->get_name(), spec_.options[i].value, text));
      }
      read.options.emplace_back(flag, std::move(text));
    }
  }
  return read;
}

Result<Arguments> read_arguments(const CommandSpec& spec, const std::vector<std::string>& arguments) {
  return ArgumentReader(spec).read(arguments);
}

std::string help_text(const CommandSpec& spec, int columns, HelpLength length) {
  const auto width = static_cast<std::size_t>(std::max(columns, 20));
  const bool is_short = length == HelpLength::kShort && !spec.basic.empty();
  std::string text;
  wrap(spec.summary, 0, width, 0, text);
  text += fmt::format("\nUsage: lamina {} [OPTIONS]{}\n", spec.name,
                      spec.operand.empty() ? "" : fmt::format(" [{}...]", spec.operand));
  if (!spec.operand.empty()) {
    text += '\n';
    add_entry(spec.operand, spec.operand_meaning, width, text);
  }
  text += "\nOptions:\n";
  if (is_short) {
    for (const std::string_view flag : spec.basic) add_option_entry(*spec.find(flag), width, text);
    add_entry("--help-all", fmt::format("all {} options", spec.options.size()), width, text);
    return text + first_examples(spec.end());
  }
  add_entry("-h, --help", spec.basic.empty() ? "this text" : "the most common options", width, text);
  if (!spec.basic.empty()) add_entry("--help-all", "this text", width, text);
  std::string_view group;
  for (const OptionSpec& option : spec.options) {
    if (option.group != group) text += fmt::format("\n{}:\n", option.group);
    group = option.group;
    add_option_entry(option, width, text);
  }
  if (const std::string end = spec.end(); !end.empty()) text += "\n" + end + "\n";
  return text;
}

}  // namespace lamina::pipeline
