// pipeline/cli/arguments.h: what a command takes on the command line, and what stands there.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/status.h"
#include "stages/text/value.h"

namespace lamina::pipeline {

/// One option of a command. A switch has no value.
struct OptionSpec {
  std::string flag;   // "-o,--output"
  std::string value;  // "MM"; empty for a switch
  std::string meaning;
  std::string preset;  // shown in the help; empty if there is none
  std::string group;   // heading in the help
};

/// The arguments of a command: help, manual pages, shell completion and the documentation's tests are made from it.
struct CommandSpec {
  std::string name, summary;
  std::string operand, operand_meaning;  // "PART", "..."; as many as there are
  std::vector<OptionSpec> options;
  std::string closing;                                                // examples, at the end of the help
  std::string (*more)() = nullptr;                                    // the same, made only where it is read
  std::vector<std::pair<std::string_view, std::string_view>> absent;  // options of other commands, and why this one has none

  /// The option that `flag`, "--output" or "-o", names, or nullptr.
  const OptionSpec* find(std::string_view flag) const;
  /// All that stands at the end of the help.
  std::string end() const { return more == nullptr ? closing : closing + more(); }
};

/// What a reader (value.h, number_text.h) says of an option's text, behind the option's name; "" is no error.
/// errors  kUsage
Status at_option(std::string_view flag, const std::string& wrong);

/// What stands on the command line, as text.
struct Arguments {
  std::vector<std::string> operands;
  std::vector<std::pair<std::string, std::string>> options;  // (spec flag, text); switches with an empty text
  std::optional<std::string> help;                           // --help is there: nothing else is to be done
  std::vector<std::string> given;                            // as they were typed, all of them

  bool has(std::string_view flag) const;
  std::string text(std::string_view flag) const;  // last one given, or ""
  std::vector<std::string> all(std::string_view flag) const;

  /// Sets a value by the text of an option, if it is there. errors  kUsage: "--jobs: ...", outside of the limits or no value
  template <class T>
  Status read(std::string_view flag, const Limits& limits, T& value) const {
    return has(flag) ? at_option(flag, read_value(text(flag), limits, value)) : Status();
  }
  template <class T>
  Status read(std::string_view flag, std::string (*reader)(std::string_view, T&), T& value) const {
    return has(flag) ? at_option(flag, reader(text(flag), value)) : Status();
  }
};

/// Reads the arguments behind the command's name. errors  kUsage: unknown option (and which one was probably meant),
/// value missing
Result<Arguments> read_arguments(const CommandSpec& spec, const std::vector<std::string>& arguments);

}  // namespace lamina::pipeline
