// pipeline/flow/interrupt.h: Ctrl-C asks a job to stop; a second one does not ask.
#pragma once

#include <atomic>

namespace lamina::pipeline {

/// From now on the first SIGINT or SIGTERM sets the flag that is returned; the next one ends the program with 130.
/// While there is nothing that would be lost, the first one ends it: reading a large part may take long, and no library
/// that reads it looks at the flag. The first call in a program decides: a batch has results to keep from the start.
const std::atomic<bool>& watch_for_interrupts(bool something_to_keep = true);

/// There is now: the first signal asks from here on.
void keep_what_is_done();

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
