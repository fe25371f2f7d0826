// The one file that knows the command line library.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <deque>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/names.h"
#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

thread_local CommandSpec* asked_spec = nullptr;

}  // namespace

CommandSpec spec_of(const Command& command) {
  if (command.name == "preview") return preview_spec();  // it hands the process over to another program
  CommandSpec spec;
  asked_spec = &spec;
  ConsoleCapture unheard;
  command.run({"--help"});
  asked_spec = nullptr;
  return spec;
}

Result<Arguments> read_arguments(const CommandSpec& spec, const std::vector<std::string>& arguments) {
  if (asked_spec != nullptr) {
    *asked_spec = spec;
    Arguments only_asked;
    only_asked.help = "";
    return only_asked;
  }
  const auto wrong = [&](const std::string& what) {
    const std::string line = one_line(what);
    if (line.ends_with('?')) return Error{Fault::kUsage, line};
    return Error{Fault::kUsage, fmt::format("{}; see lamina {} --help", line, spec.name)};
  };
  CLI::App app(spec.summary + "\n", "lamina " + spec.name);
  app.footer("\n" + spec.closing);
  app.get_formatter()->column_width(28);
  app.allow_extras();

  Arguments read;
  std::vector<std::string_view> known = {"--help"};
  std::deque<std::vector<std::string>> values;  // stay where they are
  std::vector<CLI::Option*> options;
  for (const OptionSpec& option : spec.options) {
    std::vector<std::string>& texts = values.emplace_back();
    const std::string meaning =
        option.preset.empty() ? option.meaning : fmt::format("{} (default {})", option.meaning, option.preset);
    CLI::Option* added = option.value.empty() ? app.add_flag(option.flag, meaning)
                                              : app.add_option(option.flag, texts, meaning)
                                                    ->type_name(option.value)
                                                    ->expected(1)
                                                    ->allow_extra_args(false)
                                                    ->take_all();
    if (!option.group.empty()) added->group(option.group);
    options.push_back(added);
    for (const std::string_view name : split(option.flag, ",")) known.push_back(name);
  }
  if (!spec.operand.empty()) {
    app.add_option(spec.operand, read.operands, spec.operand_meaning)->type_name("")->expected(0, 1 << 29);
  }
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::CallForHelp&) {
    read.help = app.help();
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
    return wrong(extra.starts_with('-') ? fmt::format("{}: no such option{}", name, suggest(name, known))
                                        : fmt::format("'{}': not expected here", extra));
  }
  for (std::size_t i = 0; i < options.size(); ++i) {
    const std::string& flag = spec.options[i].flag;
    if (spec.options[i].value.empty()) {
      if (options[i]->count() > 0) read.options.emplace_back(flag, "");
      continue;
    }
    for (std::string& text : values[i]) {
      // -o --resume: an option that was left without its value.
      if (std::ranges::find(known, std::string_view(text)) != known.end()) {
        return wrong(fmt::format("{}: needs a value, {}, before {}", options[i]->get_name(), spec.options[i].value, text));
      }
      read.options.emplace_back(flag, std::move(text));
    }
  }
  return read;
}

}  // namespace lamina::pipeline
