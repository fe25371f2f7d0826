// pipeline/cli/command.h: the program `lamina`, and what its commands share.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// Runs the command that the arguments name and returns the exit code; errors are one line on stderr.
int run_program(int argument_count, char** arguments);

/// One option of a command. A switch has no value.
struct OptionSpec {
  std::string flag;   // "-o,--output"
  std::string value;  // "MM"; empty for a switch
  std::string meaning;
  std::string preset;  // shown in the help; empty if there is none
  std::string group;   // heading in the help
};

struct CommandSpec {
  std::string name, summary;
  std::string operand, operand_meaning;  // "PART", "..."; as many as there are
  std::vector<OptionSpec> options;
  std::string closing;                                                // examples, at the end of the help
  std::vector<std::pair<std::string_view, std::string_view>> absent;  // options of other commands, and why this one has none
};

/// What stands on the command line, as text.
struct Arguments {
  std::vector<std::string> operands;
  std::vector<std::pair<std::string, std::string>> options;  // (spec flag, text); switches with an empty text
  std::optional<std::string> help;                           // asked for: nothing else is to be done

  bool has(std::string_view flag) const;
  std::string text(std::string_view flag) const;  // last one given, or ""
  std::vector<std::string> all(std::string_view flag) const;
};

/// Reads the arguments behind the command's name. errors  kUsage: unknown option (and which one was probably meant),
/// value missing
Result<Arguments> read_arguments(const CommandSpec& spec, const std::vector<std::string>& arguments);

/// One command of the program. It begins by reading its arguments, so that it can be asked for its definition.
struct Command {
  std::string_view name, summary;
  int (*run)(const std::vector<std::string>&);
};

/// All commands, in the order of the help.
std::span<const Command> commands();

/// The command of that name, or nullptr.
const Command* find_command(std::string_view name);

/// The definition of a command's arguments, from which help, manual pages, shell completion and the documentation's
/// tests are made. Nothing of the command runs.
CommandSpec spec_of(const Command& command);

/// That of lamina preview, whose work is done by a program of its own.
CommandSpec preview_spec();

// --- one file each
int run_jet_command(const std::vector<std::string>& arguments);
int run_slice_command(const std::vector<std::string>& arguments);
int run_heights_command(const std::vector<std::string>& arguments);
int run_extrude_command(const std::vector<std::string>& arguments);
int run_info_command(const std::vector<std::string>& arguments);
int run_verify_command(const std::vector<std::string>& arguments);
int run_merge_command(const std::vector<std::string>& arguments);
int run_machines_command(const std::vector<std::string>& arguments);
int run_calibrate_command(const std::vector<std::string>& arguments);
int run_permeability_command(const std::vector<std::string>& arguments);
int run_preview_command(const std::vector<std::string>& arguments);
int run_batch_command(const std::vector<std::string>& arguments);
int run_report_command(const std::vector<std::string>& arguments);
int run_completion_command(const std::vector<std::string>& arguments);
int run_manual_command(const std::vector<std::string>& arguments);

}  // namespace lamina::pipeline
