#include "pipeline/interrupt.h"

#include <unistd.h>

#include <csignal>

namespace lamina::pipeline {
namespace {

std::atomic<bool> interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // a signal handler may touch nothing else

void on_signal(int) {
  if (interrupted.exchange(true)) ::_exit(130);
}

thread_local const std::atomic<bool>* own_flag = nullptr;

}  // namespace

InterruptScope::InterruptScope(const std::atomic<bool>& flag) : outer_(own_flag) { own_flag = &flag; }
InterruptScope::~InterruptScope() { own_flag = outer_; }

const std::atomic<bool>& watch_for_interrupts() {
  if (own_flag != nullptr) return *own_flag;
  struct sigaction action {};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return interrupted;
}

}  // namespace lamina::pipeline
