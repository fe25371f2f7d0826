// pipeline/cli/console.h: the terminal. A reader that has gone away is no reason to crash.
#pragma once

#include <optional>
#include <string_view>

#include "pipeline/cli/command.h"
#include "pipeline/cli/progress_bar.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// The program's own context: stdout, stderr, signals, and a progress bar on a terminal.
class Console : public Context {
 public:
  void say_text(std::string_view text) override;
  int complain(const Error& error) override;
  Status print(std::string_view text) override;
  Status give(const nlohmann::ordered_json& value) override;
  void progress(const ProgressEvent& event) override;
  const std::atomic<bool>& cancel() override;

  bool quiet = false;  // no progress is told

 private:
  std::optional<Progress> progress_;
};

// --- the same without a context
/// One line to stderr, line breaks and control characters taken out.
void say(std::string_view line);

/// Text to stderr as it is.
void say_text(std::string_view text);

/// Says an error, "lamina: ...", and gives the exit code that belongs to it.
int fail(const Error& error);

/// Results to stdout. errors  kOutput if they could not be written (a full disk); a reader that closed the pipe is none
Status print(std::string_view text);

/// Whether stderr is a terminal.
bool is_terminal();
/// Columns of the terminal at stderr, or 80.
int terminal_columns();

}  // namespace lamina::pipeline
