// Only this file depends on the command line library.
#include "pipeline/cli/terminal/arguments.h"

#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <deque>

#include "pipeline/cli/terminal/slicer_aliases.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/names.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/terminal.h"

namespace lamina::pipeline {

const OptionSpec* CommandSpec::find(std::string_view flag) const {
  for (const OptionSpec& option : options) {
    if (const auto flags = split(option.flag, ","); std::ranges::find(flags, flag) != flags.end()) return &option;
  }
  return nullptr;
}

Status at_option(std::string_view flag, const std::string& wrong) {
  if (wrong.empty()) return {};
  return Error{Fault::kUsage, fmt::format("{}: {}", flag.substr(flag.rfind(',') + 1), wrong)};
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

Result<Arguments> read_arguments(const CommandSpec& spec, const std::vector<std::string>& arguments) {
  const auto wrong = [&](const std::string& what) {
    const std::string line = one_line(what);
    if (line.ends_with('?')) return Error{Fault::kUsage, line};
    return Error{Fault::kUsage, fmt::format("{}; see lamina {} --help", line, spec.name)};
  };
  CLI::App app("", "lamina " + spec.name);
  app.allow_extras();

  Arguments read;
  read.given = arguments;
  std::vector<std::string_view> known = {"--help"};
  std::deque<std::vector<std::string>> values;  // addresses must not change
  std::vector<CLI::Option*> options;
  for (const OptionSpec& option : spec.options) {
    std::vector<std::string>& texts = values.emplace_back();
    options.push_back(
        option.value.empty()
            ? app.add_flag(option.flag)
            : app.add_option(option.flag, texts)->type_name(option.value)->expected(1)->allow_extra_args(false)->take_all());
    for (const std::string_view name : split(option.flag, ",")) known.push_back(name);
  }
  if (!spec.operand.empty()) {
    app.add_option(spec.operand, read.operands)->type_name("")->expected(0, 1 << 29);
  }
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::CallForHelp&) {
    read.help = help_text(spec, std::clamp(terminal_columns(), 40, 120));
    return read;
  } catch (const CLI::Error& error) {
    return wrong(error.what());
  }
  for (const std::string& extra : app.remaining()) {
    if (extra == "--") continue;
    const std::string_view name = std::string_view(extra).substr(0, extra.find('='));
    for (const auto& [flag, why] : spec.absent) {
      if (name == flag) return wrong(fmt::format("{}: {}", flag, why));
    }
    if (!extra.starts_with('-')) return wrong(fmt::format("'{}': not expected here", extra));
    const std::string hint = slicer_alias(name, spec);
    return wrong(fmt::format("{}: no such option{}", name, hint.empty() ? suggest(name, known) : hint));
  }
  for (std::size_t i = 0; i < options.size(); ++i) {
    const std::string& flag = spec.options[i].flag;
    if (spec.options[i].value.empty()) {
      if (options[i]->count() > 0) read.options.emplace_back(flag, "");
      continue;
    }
    for (std::string& text : values[i]) {
      // -o --resume: an option without its value.
      if (std::ranges::find(known, std::string_view(text)) != known.end()) {
        return wrong(fmt::format("{}: needs a value, {}, before {}", options[i]->get_name(), spec.options[i].value, text));
      }
      read.options.emplace_back(flag, std::move(text));
    }
  }
  return read;
}

}  // namespace lamina::pipeline
