#include "pipeline/cli/console.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>

#include "pipeline/job/errors.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/terminal.h"

namespace lamina::pipeline {
namespace {

// 0 or the reason.
int write_all(int file, std::string_view text) { return lamina::write_all(file, std::as_bytes(std::span(text))); }

std::atomic<bool> interrupted{false}, keeping{false}, prints_json{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // a signal handler may touch nothing else

[[noreturn]] void end() {
  remove_watched();
  ::_exit(130);
}

/// Ends the program as the signal would, without temporary files.
void end_by_signal(int signal) {
  remove_watched();
  ::raise(signal);  // handled as by default from the first time on, and not blocked
}

timer_t patience;  // runs out kPatience after the first signal
std::atomic<bool> patient{false};
constexpr itimerspec kPatience{{0, 0}, {0, 800'000'000}};

void put_piece(std::string_view text) {
  if (::write(STDERR_FILENO, text.data(), text.size()) < 0) end();
}

/// Of a signal handler: a line, as JSON if that is requested.
[[noreturn]] void end_with(std::string_view what) {
  put_piece(prints_json ? "{\"event\":\"error\",\"text\":\"" : "lamina: ");
  put_piece(what);
  put_piece(prints_json ? "\",\"code\":130}\n{\"event\":\"end\",\"code\":130}\n" : "\n");
  end();
}

/// Ends a program that works on in spite of a signal, within a layer or a library. Finished layers are on record, and files
/// have their names only once they are whole.
void on_patience(int) { end_with("interrupted; layers on record stay for --resume"); }

/// From now on a signal ends the program within a second.
void lose_patience() {
  if (patient) return;
  struct sigaction action {};
  action.sa_handler = on_patience;
  sigemptyset(&action.sa_mask);
  sigaction(SIGRTMIN, &action, nullptr);
  sigevent event{};
  event.sigev_notify = SIGEV_SIGNAL;
  event.sigev_signo = SIGRTMIN;
  patient = timer_create(CLOCK_MONOTONIC, &event, &patience) == 0;
}

void on_signal(int signal) {
  if (!keeping) {
    end_with("interrupted before the first layer");
  }
  const bool again = interrupted.exchange(true);
  if (again && signal == SIGXCPU) return;  // comes every second once the limit is reached
  if (again || !keeping) end();
  if (patient) timer_settime(patience, 0, &kPatience, nullptr);
}

/// From now on the first SIGINT, SIGTERM, SIGHUP or SIGXCPU sets the returned flag; the next one ends the program with 130,
/// as does the lapse of kPatience.
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
  sigaction(SIGXCPU, &action, nullptr);
  sigaction(SIGHUP, nullptr, &before);
  if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  return interrupted;
}

}  // namespace

void keep_on_signals() { keeping = true; }

void handle_signals() {
  std::signal(SIGPIPE, SIG_IGN);  // a closed reader is an error of write(), not the end
  std::signal(SIGXFSZ, SIG_IGN);  // and so is a limit on file sizes
  struct sigaction action {
  }, before{};
  action.sa_handler = end_by_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_NODEFER);
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXCPU, SIGALRM, SIGVTALRM, SIGUSR1, SIGUSR2}) {
    sigaction(signal, nullptr, &before);
    if (before.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);
  }
}

Console::~Console() { Console::say_text({}); }

void Console::begin_json() { json_ = prints_json = true; }

void Console::put(const Json& line) {
  const std::lock_guard lock(writing_);
  write_all(STDERR_FILENO, json_line(line));
}

void Console::put(const ProgressEvent& event) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds kPause(500);
  const bool is_next = !last_ || last_->stage != event.stage;
  const Clock::time_point now = Clock::now();
  if (!is_next && event.done != event.total && now - put_at_ < kPause) return;
  if (!is_next && event.done == last_->done && event.total == last_->total) return;
  last_ = event;
  put_at_ = now;
  constexpr const char* kStages[] = {"load", "index", "layers", "builds", "jobs"};
  Json line{{"event", "progress"}, {"stage", kStages[static_cast<std::size_t>(event.stage)]}};
  if (event.total > 0) line["done"] = event.done, line["total"] = event.total;
  line["seconds"] = std::chrono::duration<double>(now - begun_).count();
  put(line);
}

int Console::end(int code) {
  if (!json_) return code;
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun_).count();
  put(Json{{"event", "end"}, {"code", code}, {"seconds", seconds}});
  return code;
}

void Console::say_text(std::string_view text) {
  while (json_ && !text.empty()) {
    const std::size_t line = std::min(text.find('\n'), text.size());
    if (line > 0) put(Json{{"event", "message"}, {"text", one_line(text.substr(0, line))}});
    text.remove_prefix(std::min(line + 1, text.size()));
  }
  if (progress_) write_all(STDERR_FILENO, progress_->clear());
  write_all(STDERR_FILENO, text);
}

int Console::complain(const Error& error) {
  if (json_) {
    put(Json{{"event", "error"}, {"text", one_line(error.message)}, {"code", static_cast<int>(error.fault)}});
    return static_cast<int>(error.fault);
  }
  say("lamina: " + error.message);
  return static_cast<int>(error.fault);
}

Status Console::print(std::string_view text) {
  const int reason = write_all(STDOUT_FILENO, text);
  if (reason == 0 || reason == EPIPE) return {};
  return failure(Fault::kOutput, "standard output: {}", std::strerror(reason));
}

Status Console::give(const Json& value) { return print(json_line(with_schema(value))); }

void Console::progress(const ProgressEvent& event) {
  using Stage = ProgressEvent::Stage;
  const bool counted = event.stage == Stage::kLayers || event.stage == Stage::kBuilds;
  if (counted) keep_on_signals();
  if (event.stage == Stage::kLayers) lose_patience();  // builds are removed after a signal, which may take longer
  if (json_) return put(event);
  if (event.stage == Stage::kJobs) return;  // a batch draws its own line
  if (!progress_) {
    using Style = Progress::Style;
    progress_.emplace(quiet ? Style::kSilent : is_terminal() ? Style::kBar : Style::kLines);
  }
  write_all(STDERR_FILENO, counted
                               ? progress_->report(event.done, event.total, event.stage == Stage::kBuilds ? "builds" : "layers")
                               : progress_->begin(event.stage == Stage::kLoading ? "loading parts" : "indexing"));
}

const std::atomic<bool>& Console::cancel() { return watch_for_signals(); }

}  // namespace lamina::pipeline
