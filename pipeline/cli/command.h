// pipeline/cli/command.h: the program `lamina`: its commands as rows of a table, and what a command gets and gives.
#pragma once

#include <atomic>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/cli/arguments.h"
#include "pipeline/plan/progress.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Where a command's words and results go, and what tells it to stop: the console of the program, or a job of a batch.
class Context {
 public:
  virtual ~Context() = default;

  // --- for people
  /// Text as it is.
  virtual void say_text(std::string_view text) = 0;
  /// One line, line breaks and control characters taken out.
  void say(std::string_view line);
  /// Something is wrong and the command goes on, as with its next operand. returns  the exit code that belongs to it
  virtual int complain(const Error& error) = 0;

  // --- for scripts; errors  kOutput if it could not be written; a reader that closed the pipe is none
  virtual Status print(std::string_view text) = 0;
  /// A value, printed as one line of JSON.
  virtual Status give(const nlohmann::ordered_json& value) = 0;

  // --- while it runs
  /// How far a job is. Layers that have begun are worth keeping: from then on cancel() is set rather than the program ended.
  virtual void progress(const ProgressEvent& event) = 0;
  /// Set when the command has to stop. A command that never asks for it is ended by the first signal.
  virtual const std::atomic<bool>& cancel() = 0;
};

/// How a command ended. What it had to say and to give went into its context, all but the error that ended it.
struct Outcome {
  Outcome() = default;
  Outcome(int exit_code) : code(exit_code) {}
  Outcome(const Error& failure) : code(static_cast<int>(failure.fault)), error(failure) {}
  Outcome(const Status& status) {
    if (!status) *this = status.error();
  }

  int code = 0;
  std::optional<Error> error;
  std::uint32_t layers_planned = 0, layers_kept = 0;  // of a job; kept: they were there already
};

/// One command of the program.
struct Command {
  std::string_view name, summary;
  CommandSpec (*spec)();
  Outcome (*run)(const Arguments&, Context&);
  bool reads_itself = false;  // another program reads its arguments, which are handed over as they were typed
  /// Ending of the name that a batch gives its output, if that is a file; nullptr if it has no name of its own.
  std::string (*ending)(const Arguments&) = nullptr;
};

/// All commands, in the order of the help.
std::span<const Command* const> commands();

/// The command of that name, or nullptr.
const Command* find_command(std::string_view name);

/// The definition of a command's arguments, under its name.
CommandSpec spec_of(const Command& command);

/// "'jett' is no command, did you mean 'jet'? ..."
std::string unknown_command(std::string_view name);

/// Runs a command; exceptions become errors.
Outcome run(const Command& command, const Arguments& arguments, Context& context);

// --- programs
class Console;
using Program = Outcome (*)(const std::vector<std::string>& words, Console&);

/// Runs a program on the words behind its name. returns  the exit code; errors are one line on stderr
int run_program(int argument_count, char** arguments, Program program);

/// The program `lamina`: the command that the first word names.
Outcome run_lamina(const std::vector<std::string>& words, Console& console);

/// Reads words as the arguments of a command and runs it.
Outcome run_command(const Command& command, const std::vector<std::string>& words, Console& console);

// --- one file each, in commands/; plan.cpp has those that plan a job, manual.cpp completion_command too
extern const Command jet_command, slice_command, heights_command, extrude_command, info_command, verify_command,
    calibrate_command, permeability_command, merge_command, machines_command, preview_command, report_command, batch_command,
    completion_command, manual_command;

}  // namespace lamina::pipeline
