#include "pipeline/cli/signals.h"

#include <unistd.h>

#include <csignal>
#include <string_view>

namespace lamina::pipeline {
namespace {

std::atomic<bool> interrupted{false}, keeping{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // a signal handler may touch nothing else

void on_signal(int) {
  if (!keeping) {
    constexpr std::string_view kLine = "lamina: interrupted before the first layer\n";
    if (::write(STDERR_FILENO, kLine.data(), kLine.size()) < 0) ::_exit(130);
  }
  if (interrupted.exchange(true) || !keeping) ::_exit(130);
}

}  // namespace

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

void keep_on_signals() { keeping = true; }

}  // namespace lamina::pipeline
