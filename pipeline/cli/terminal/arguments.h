// pipeline/cli/terminal/arguments.h: the options of a command, and the arguments of one call.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/status.h"
#include "stages/support/text/value.h"

namespace lamina::pipeline {

/// One option of a command. A switch takes no value.
struct OptionSpec {
  std::string flag;   // "-o,--output"
  std::string value;  // "MM"; empty for a switch
  std::string meaning;
  std::string preset;                        // shown in the help; empty if there is none
  std::string group;                         // heading in the help
  std::vector<std::string_view> words = {};  // that it takes; of static storage
};

/// The arguments of a command: the source of help, manual pages, shell completion and the documentation's tests.
struct CommandSpec {
  std::string name, brief, summary;             // brief: on one line
  std::string operand, operand_meaning;         // "PART", "..."; any number
  std::vector<std::string_view> operand_words;  // that it takes; of static storage
  std::vector<OptionSpec> options;
  std::vector<std::string_view>
      basic;                        // flags of the short help, in the order in which a job needs them; empty: --help has all
  std::string closing;              // examples, at the end of the help
  std::string (*more)() = nullptr;  // the same, made only when the help is read
  std::vector<std::pair<std::string_view, std::string_view>> absent;  // other commands' options, and why they are missing here

  /// The option named by `flag`, "--output" or "-o", or nullptr.
  const OptionSpec* find(std::string_view flag) const;
  /// The end of the help, complete.
  std::string end() const { return more == nullptr ? closing : closing + more(); }
};

/// The message of a reader (value.h, number_text.h) after the option's name; "" means no error.
/// errors  kUsage
Status at_option(std::string_view flag, const std::string& wrong);

/// The arguments of a call, as text.
struct Arguments {
  std::vector<std::string> operands;
  std::vector<std::pair<std::string, std::string>> options;  // (spec flag, text); switches with an empty text
  std::optional<std::string> help;                           // set by --help and --help-all: show it and do nothing else
  std::vector<std::string> given;                            // all words as typed

  bool has(std::string_view flag) const;
  std::string text(std::string_view flag) const;  // last one given, or ""
  std::vector<std::string> all(std::string_view flag) const;

  /// Sets a value from an option's text, if present. errors  kUsage: "--jobs: ...", out of range or invalid
  template <class T>
  Status read(std::string_view flag, const Limits& limits, T& value) const {
    return has(flag) ? at_option(flag, with_comma_hint(read_value(text(flag), limits, value), text(flag))) : Status();
  }
  template <class T>
  Status read(std::string_view flag, std::string (*reader)(std::string_view, T&), T& value) const {
    return has(flag) ? at_option(flag, with_comma_hint(reader(text(flag), value), text(flag))) : Status();
  }
};

/// Short: the basic options and the first examples, if the command has basic options.
enum class HelpLength { kShort, kAll };

/// The help of a command, in lines of `columns`; notes and examples stay as they are.
std::string help_text(const CommandSpec& spec, int columns, HelpLength length);

/// Reads the arguments of many calls of a command, which outlives it. For one thread.
class ArgumentReader {
 public:
  explicit ArgumentReader(const CommandSpec& spec);
  ~ArgumentReader();
  /// As read_arguments(). cost  without making the parser, which takes most of its time
  Result<Arguments> read(const std::vector<std::string>& arguments);

 private:
  struct State;
  const CommandSpec& spec_;
  std::unique_ptr<State> state_;
};

/// Parses the arguments after the command's name.
/// errors  kUsage: unknown option (with the nearest name), missing value
Result<Arguments> read_arguments(const CommandSpec& spec, const std::vector<std::string>& arguments);

/// "; did you mean '--layer'?" for an option of PrusaSlicer, Slic3r or CuraEngine whose counterpart the command has, with
/// what differs; "; lamina makes no supports" for what lamina does not make; else "". Sources: PrusaSlicer
/// src/libslic3r/PrintConfig.cpp, Cura fdmprinter.def.json.
std::string slicer_alias(std::string_view flag, const CommandSpec& spec);

}  // namespace lamina::pipeline
