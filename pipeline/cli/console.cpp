#include "pipeline/cli/console.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "pipeline/cli/signals.h"
#include "pipeline/text/json.h"
#include "pipeline/text/json_text.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

// 0 or the reason.
int write_all(int file, std::string_view text) { return write::write_all(file, std::as_bytes(std::span(text))); }

}  // namespace

void say(std::string_view line) { say_text(one_line(line) + "\n"); }

void say_text(std::string_view text) { write_all(STDERR_FILENO, text); }

int fail(const Error& error) {
  say("lamina: " + error.message);
  return static_cast<int>(error.fault);
}

Status print(std::string_view text) {
  const int reason = write_all(STDOUT_FILENO, text);
  if (reason == 0 || reason == EPIPE) return {};
  return Error{Fault::kOutput, fmt::format("standard output: {}", std::strerror(reason))};
}

bool is_terminal() { return ::isatty(STDERR_FILENO) == 1; }

int terminal_columns() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

void Console::say_text(std::string_view text) {
  if (progress_) progress_->clear();
  pipeline::say_text(text);
}

int Console::complain(const Error& error) {
  if (progress_) progress_->clear();
  return fail(error);
}

Status Console::print(std::string_view text) { return pipeline::print(text); }

Status Console::give(const Json& value) { return pipeline::print(json_line(value)); }

void Console::progress(const ProgressEvent& event) {
  if (event.stage == ProgressEvent::Stage::kLayers) keep_on_signals();
  if (!progress_) {
    progress_.emplace(quiet ? Progress::Style::kSilent : is_terminal() ? Progress::Style::kBar : Progress::Style::kLines);
  }
  (*progress_)(event);
}

const std::atomic<bool>& Console::cancel() { return watch_for_signals(); }

}  // namespace lamina::pipeline
