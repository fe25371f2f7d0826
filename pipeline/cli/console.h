// pipeline/cli/console.h: what is said to people and scripts. A reader that has gone away is no reason to crash.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// One line to stderr, line breaks and control characters taken out.
void say(std::string_view line);

/// Text to stderr as it is.
void say_text(std::string_view text);

/// Says an error, "lamina: ...", and gives the exit code that belongs to it.
int fail(const Error& error);

/// Results to stdout. errors  kOutput if they could not be written (a full disk); a reader that closed the pipe is none
Status print(std::string_view text);

/// What this thread says goes here instead of to stderr and stdout as long as the object lives: for a job of a batch.
/// Other threads are not affected, and captures of one thread may be nested.
class ConsoleCapture {
 public:
  ConsoleCapture();
  ~ConsoleCapture();
  ConsoleCapture(const ConsoleCapture&) = delete;
  ConsoleCapture& operator=(const ConsoleCapture&) = delete;
  std::string out, err;

 private:
  ConsoleCapture* outer_;
};

/// Whether stderr is a terminal.
bool is_terminal();
/// Columns of the terminal at stderr, or 80.
int terminal_columns();

}  // namespace lamina::pipeline
