// pipeline/cli/command.h: the program `lamina`: a table of commands, and their input and output.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/cli/terminal/arguments.h"
#include "pipeline/plan/progress.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/text/json_value.h"

namespace lamina::load {
class PartStore;
}

namespace lamina::pipeline {

class JobCache;  // pipeline/cache/store.h

/// Of all JSON objects that commands print; it grows when a key is removed or redefined (docs/reference/json.md).
inline constexpr std::int64_t kJsonSchema = 1;

/// The object after its first member, "schema".
Json with_schema(const Json& value);

/// Receives a command's messages and results, and can cancel it. Implemented by the console and by a batch job.
class Context {
 public:
  virtual ~Context() = default;

  // --- for people
  /// Text, unchanged.
  virtual void say_text(std::string_view text) = 0;
  /// One line; line breaks and control characters are removed.
  void say(std::string_view line);
  /// Reports an error after which the command continues, such as one bad operand. returns  the exit code of the error
  virtual int complain(const Error& error) = 0;

  /// A cache that the caller gives its jobs; nullptr for none.
  virtual JobCache* cache() { return nullptr; }
  /// Loaded parts of the caller's other jobs; null for none.
  virtual std::shared_ptr<load::PartStore> loaded() { return {}; }

  /// How people know a file, where a call works on files that it made itself.
  virtual std::string shown(const std::string& path) { return path; }

  // --- for scripts; errors  kOutput if writing fails; a closed pipe is not an error
  virtual Status print(std::string_view text) = 0;
  /// Prints an object, with its schema, as one line of JSON.
  virtual Status give(const Json& value) = 0;

  // --- while it runs
  /// Reports progress. Once layers have started, a signal sets cancel() instead of ending the program, to keep them.
  virtual void progress(const ProgressEvent& event) = 0;
  /// Set when the command must stop. The first signal ends a command that never calls this.
  virtual const std::atomic<bool>& cancel() = 0;
};

/// --progress, of commands with long work.
inline OptionSpec progress_option() {
  return {"--progress", "KIND", "json: progress and messages as JSON lines on stderr", "auto", "Run", {"auto", "json"}};
}

/// Lines that a call requested: on stdout, or on stderr where stdout is for JSON; none with --quiet.
class Answer {
 public:
  Answer(const Arguments& arguments, Context& context) : context_(context), arguments_(arguments) {}
  void say(std::string_view line);
  /// errors  kOutput: a line was not written
  Status status() const { return status_; }

 private:
  Context& context_;
  const Arguments& arguments_;
  Status status_;
};

/// Reports what is wrong with the files of a directory, a line each and the number of those that are not listed.
void complain_of(const Faults& faults, const std::string& directory, Context& context);

/// How a command ended. Messages and results go to the context; only the final error is here.
struct Outcome {
  Outcome() = default;
  Outcome(int exit_code) : code(exit_code) {}
  Outcome(const Error& failure) : code(static_cast<int>(failure.fault)), error(failure) {}
  Outcome(const Status& status) {
    if (!status) *this = status.error();
  }

  int code = 0;
  std::optional<Error> error;
  std::uint32_t layers_planned = 0, layers_kept = 0;  // of a job; kept: already present
  std::optional<TreeDigest> files;                    // of all files of the output, where they are known
};

/// One command of the program.
struct Command {
  std::string_view name, summary;
  CommandSpec (*spec)();
  Outcome (*run)(const Arguments&, Context&);
  bool reads_itself = false;  // passes its arguments unread to another program
  /// Extension of the output file that a batch names after the job; nullptr if the batch names no file.
  std::string (*ending)(const Arguments&) = nullptr;
};

/// All commands, in the order of the help.
std::span<const Command* const> commands();

/// The command of that name, or nullptr.
const Command* find_command(std::string_view name);

/// A command's argument definition, with its name and summary set; those of all commands in the order of the help.
CommandSpec spec_of(const Command& command);
std::vector<CommandSpec> all_specs();

/// "unknown command 'jett'; did you mean 'jet'?"
std::string unknown_command(std::string_view name);

/// Runs a command; exceptions become errors.
Outcome run(const Command& command, const Arguments& arguments, Context& context);

// --- programs
class Console;
using Program = Outcome (*)(const std::vector<std::string>& words, Console&);

/// Runs a program on the words after its name. returns  the exit code; errors are one line on stderr
int run_program(int argument_count, char** arguments, Program program);

/// The program `lamina`: runs the command named by the first word.
Outcome run_lamina(const std::vector<std::string>& words, Console& console);

/// Parses words as the arguments of a command and runs it.
Outcome run_command(const Command& command, const std::vector<std::string>& words, Console& console);

// --- one file each in commands/, except plan.cpp (all commands that plan a job) and manual.cpp (also completion)
extern const Command jet_command, slice_command, heights_command, extrude_command, info_command, export_command, verify_command,
    nest_command, calibrate_command, permeability_command, design_command, merge_command, stream_command, convert_command,
    compare_command, machines_command, preview_command, report_command, batch_command, watch_command, cache_command,
    completion_command, manual_command;

}  // namespace lamina::pipeline
