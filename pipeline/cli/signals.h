// pipeline/cli/signals.h: Ctrl-C and its like stop a job; a second one ends the program.
#pragma once

#include <atomic>

namespace lamina::pipeline {

/// From now on the first SIGINT, SIGTERM or SIGHUP sets the flag that is returned; the next one ends the program with 130.
/// As long as nothing would be lost the first one ends it: reading a large part may take long, and no library that reads
/// it looks at the flag. SIGHUP stays ignored if it is, as under nohup.
const std::atomic<bool>& watch_for_signals();

/// There is something to keep: the first signal only sets the flag from here on.
void keep_on_signals();

}  // namespace lamina::pipeline
