// pipeline/watch/after_job.h: runs a shell command after a job.
#pragma once

#include <atomic>
#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

inline constexpr int kThenOverdue = 124;               // as of timeout(1)
inline constexpr std::chrono::seconds kKillAfter{10};  // from SIGTERM to SIGKILL

/// Runs `/bin/sh -c command` in a process group of its own. Its input is empty, its output goes to standard error.
/// variables      added to the environment; they replace those of the same name
/// limit_seconds  after which its group is ended by SIGTERM and, kKillAfter later, by SIGKILL; 0: none
/// stop           ends it in the same way
/// returns        the exit code, 128 + signal if one ended it, kThenOverdue after the limit; nothing if `stop` ended it
/// errors         kInternal: it cannot be started
Result<std::optional<int>> run_shell(const std::string& command,
                                     const std::vector<std::pair<std::string, std::string>>& variables, double limit_seconds,
                                     const std::atomic<bool>& stop);

}  // namespace lamina::pipeline
