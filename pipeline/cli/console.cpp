#include "pipeline/cli/console.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>

#include "pipeline/cli/terminal.h"
#include "stages/data/text/json.h"
#include "stages/data/text/json_text.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

// 0 or the reason.
int write_all(int file, std::string_view text) { return write::write_all(file, std::as_bytes(std::span(text))); }

std::atomic<bool> interrupted{false}, keeping{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // a signal handler may touch nothing else

void on_signal(int) {
  if (!keeping) {
    constexpr std::string_view kLine = "lamina: interrupted before the first layer\n";
    if (::write(STDERR_FILENO, kLine.data(), kLine.size()) < 0) ::_exit(130);
  }
  if (interrupted.exchange(true) || !keeping) ::_exit(130);
}

/// From now on the first SIGINT, SIGTERM or SIGHUP sets the returned flag; the next one ends the program with 130.
/// Before this call the first signal ends the program: nothing can be lost yet, loading a large part may take long, and
/// the loading libraries do not read the flag. An ignored SIGHUP stays ignored, as under nohup.
const std::atomic<bool>& watch_for_signals() {
  struct sigaction action {
  }, before{};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGHUP, nullptr, &before);
  if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  return interrupted;
}

}  // namespace

void keep_on_signals() { keeping = true; }

Console::~Console() { Console::say_text({}); }

void Console::say_text(std::string_view text) {
  if (progress_) write_all(STDERR_FILENO, progress_->clear());
  write_all(STDERR_FILENO, text);
}

int Console::complain(const Error& error) {
  say("lamina: " + error.message);
  return static_cast<int>(error.fault);
}

Status Console::print(std::string_view text) {
  const int reason = write_all(STDOUT_FILENO, text);
  if (reason == 0 || reason == EPIPE) return {};
  return Error{Fault::kOutput, fmt::format("standard output: {}", std::strerror(reason))};
}

Status Console::give(const Json& value) { return print(json_line(value)); }

void Console::progress(const ProgressEvent& event) {
  using Stage = ProgressEvent::Stage;
  const bool counted = event.stage == Stage::kLayers;
  if (counted) keep_on_signals();
  if (!progress_) {
    progress_.emplace(quiet ? Progress::Style::kSilent : is_terminal() ? Progress::Style::kBar : Progress::Style::kLines);
  }
  write_all(STDERR_FILENO, counted ? progress_->tell(event.done, event.total)
                                   : progress_->begin(event.stage == Stage::kLoading ? "loading parts" : "indexing"));
}

const std::atomic<bool>& Console::cancel() { return watch_for_signals(); }

}  // namespace lamina::pipeline
