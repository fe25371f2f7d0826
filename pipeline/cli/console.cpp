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

std::string readable_bytes(std::uint64_t bytes) {
  const double value = static_cast<double>(bytes);
  if (bytes < 1000) return fmt::format("{} B", bytes);
  if (bytes < 1000'000) return fmt::format("{:.1f} kB", value / 1e3);
  if (bytes < 1000'000'000) return fmt::format("{:.1f} MB", value / 1e6);
  return fmt::format("{:.2f} GB", value / 1e9);
}

std::string readable_seconds(double seconds) {
  if (seconds < 1) return fmt::format("{:.3f} s", seconds);
  if (seconds < 60) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<std::uint64_t>(std::min(seconds, 1e15));
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

std::string readable_count(std::uint64_t count) {
  std::string text = fmt::format("{}", count);
  for (std::size_t at = text.size(); at > 3;) text.insert(at -= 3, 1, ' ');
  return text;
}

}  // namespace lamina::pipeline
