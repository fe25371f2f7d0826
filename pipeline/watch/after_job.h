// pipeline/watch/after_job.h: runs a shell command after a job.
#pragma once

#include <atomic>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

/// Runs `/bin/sh -c command` in a process group of its own. Its input is empty, its output goes to standard error.
/// variables  added to the environment; they replace those of the same name
/// returns    the exit code, 128 + signal if one ended it; nothing if it was stopped by `stop` (SIGTERM to its group)
/// errors     kInternal: it cannot be started
Result<std::optional<int>> run_shell(const std::string& command,
                                     const std::vector<std::pair<std::string, std::string>>& variables,
                                     const std::atomic<bool>& stop);

}  // namespace lamina::pipeline
