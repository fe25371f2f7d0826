#include "pipeline/watch/after_job.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "pipeline/job/errors.h"

namespace lamina::pipeline {
namespace {

/// returns  0 or the system's error number
int start_shell(const std::string& command, const std::vector<std::string>& environment, pid_t& process) {
  std::array<std::string, 3> words = {"/bin/sh", "-c", command};
  std::array<char*, 4> arguments = {words[0].data(), words[1].data(), words[2].data(), nullptr};
  std::vector<char*> variables;
  for (const std::string& variable : environment) variables.push_back(const_cast<char*>(variable.c_str()));
  variables.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);
  posix_spawnattr_t settings;
  posix_spawnattr_init(&settings);
  posix_spawnattr_setflags(&settings, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF);
  posix_spawnattr_setpgroup(&settings, 0);
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGIO}) sigaddset(&signals, signal);  // which this program ignores
  posix_spawnattr_setsigdefault(&settings, &signals);
  const int reason = posix_spawn(&process, "/bin/sh", &files, &settings, arguments.data(), variables.data());
  posix_spawnattr_destroy(&settings);
  posix_spawn_file_actions_destroy(&files);
  return reason;
}

}  // namespace

Result<std::optional<int>> run_shell(const std::string& command,
                                     const std::vector<std::pair<std::string, std::string>>& variables, double limit_seconds,
                                     const std::atomic<bool>& stop) {
  std::vector<std::string> environment;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view name = std::string_view(*variable).substr(0, std::string_view(*variable).find('='));
    const auto is_set = [&](const auto& set) { return set.first == name; };
    if (std::ranges::none_of(variables, is_set)) environment.emplace_back(*variable);
  }
  for (const auto& [name, value] : variables) environment.push_back(fmt::format("{}={}", name, value));
  pid_t process = 0;
  if (const int reason = start_shell(command, environment, process); reason != 0)
    return failure(Fault::kInternal, "/bin/sh: {}", std::strerror(reason));
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  std::optional<Clock::time_point> kill_at;
  bool stopped = false, ended = false;
  int status = 0;
  // After SIGTERM the shell may end before the other processes of its group.
  while (!ended || (kill_at && ::kill(-process, 0) == 0)) {
    if (!ended) {
      const pid_t found = ::waitpid(process, &status, WNOHANG);
      if (found < 0 && errno != EINTR) return failure(Fault::kInternal, "--then: {}", std::strerror(errno));
      ended = found == process;
      if (ended) continue;
    }
    const auto now = Clock::now();
    const bool overdue = limit_seconds > 0 && now - begin >= std::chrono::duration<double>(limit_seconds);
    if (!kill_at && (stop || overdue)) {
      stopped = stop;
      kill_at = now + kKillAfter;
      ::kill(-process, SIGTERM);
    } else if (kill_at && now >= *kill_at) {
      ::kill(-process, SIGKILL);
      if (ended) break;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  if (stopped) return std::optional<int>();
  if (kill_at) return std::optional<int>(kThenOverdue);
  return std::optional<int>(WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status));
}

}  // namespace lamina::pipeline
