// pipeline/interrupt.h: Ctrl-C asks a job to stop; a second one does not ask.
#pragma once

#include <atomic>

namespace lamina::pipeline {

/// From now on the first SIGINT or SIGTERM sets the flag that is returned; the next one ends the program with 130.
const std::atomic<bool>& watch_for_interrupts();

/// While it lives, watch_for_interrupts() of this thread gives `flag` and leaves signals alone: whoever runs several
/// jobs decides when each of them has to stop.
class InterruptScope {
 public:
  explicit InterruptScope(const std::atomic<bool>& flag);
  ~InterruptScope();
  InterruptScope(const InterruptScope&) = delete;
  InterruptScope& operator=(const InterruptScope&) = delete;

 private:
  const std::atomic<bool>* outer_;
};

}  // namespace lamina::pipeline
