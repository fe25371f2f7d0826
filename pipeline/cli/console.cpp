#include "pipeline/cli/console.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "pipeline/text/json_text.h"

namespace lamina::pipeline {
namespace {

thread_local ConsoleCapture* capture = nullptr;

// 0 or the reason.
int write_all(int file, std::string_view text) {
  if (capture != nullptr) {
    (file == STDOUT_FILENO ? capture->out : capture->err) += text;
    return 0;
  }
  while (!text.empty()) {
    const ssize_t wrote = ::write(file, text.data(), text.size());
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote < 0) return errno;
    text.remove_prefix(static_cast<std::size_t>(wrote));
  }
  return 0;
}

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

ConsoleCapture::ConsoleCapture() : outer_(capture) { capture = this; }
ConsoleCapture::~ConsoleCapture() { capture = outer_; }

bool is_terminal() { return capture == nullptr && ::isatty(STDERR_FILENO) == 1; }

int terminal_columns() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

}  // namespace lamina::pipeline
