#include "pipeline/flow/interrupt.h"

#include <unistd.h>

#include <csignal>
#include <string_view>

namespace lamina::pipeline {
namespace {

std::atomic<bool> interrupted{false}, keeping{true};
static_assert(std::atomic<bool>::is_always_lock_free);  // a signal handler may touch nothing else

void on_signal(int) {
  if (!keeping) {
    constexpr std::string_view kLine = "lamina: interrupted before the first layer\n";
    if (::write(STDERR_FILENO, kLine.data(), kLine.size()) < 0) ::_exit(130);
  }
  if (interrupted.exchange(true) || !keeping) ::_exit(130);
}

thread_local const std::atomic<bool>* own_flag = nullptr;

}  // namespace

InterruptScope::InterruptScope(const std::atomic<bool>& flag) : outer_(own_flag) { own_flag = &flag; }
InterruptScope::~InterruptScope() { own_flag = outer_; }

const std::atomic<bool>& watch_for_interrupts(bool something_to_keep) {
  if (own_flag != nullptr) return *own_flag;
  static const bool decided = (keeping = something_to_keep, true);
  static_cast<void>(decided);
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return interrupted;
}

void keep_what_is_done() { keeping = true; }

}  // namespace lamina::pipeline
