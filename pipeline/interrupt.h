// pipeline/interrupt.h: Ctrl-C asks a job to stop; a second one does not ask.
#pragma once

#include <atomic>

namespace lamina::pipeline {

/// From now on the first SIGINT or SIGTERM sets the flag that is returned; the next one ends the program with 130.
const std::atomic<bool>& watch_for_interrupts();

}  // namespace lamina::pipeline
