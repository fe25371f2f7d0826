#include "pipeline/cli/preview_program.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

namespace lamina::pipeline {
namespace {

constexpr const char* kProgram = "lamina-preview";

Error not_started(int reason) {
  return {Fault::kInternal,
          fmt::format("{}: {}; it belongs beside lamina or into PATH, install it there", kProgram, std::strerror(reason))};
}

/// The program beside this one; empty if there is none.
std::string program_beside() {
  std::error_code error;
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path beside = own.parent_path() / kProgram;
  return !error && std::filesystem::exists(beside, error) ? beside.string() : std::string();
}

/// A file in memory that no folder shows.
std::unique_ptr<std::FILE, int (*)(std::FILE*)> memory_file() {
  const int file = ::memfd_create(kProgram, MFD_CLOEXEC);
  return {file < 0 ? nullptr : ::fdopen(file, "w+"), &std::fclose};
}

}  // namespace

Error hand_over_to_preview(const std::vector<std::string>& arguments) {
  std::vector<std::string> copies = arguments;
  std::vector<char*> texts = {const_cast<char*>(kProgram)};
  for (std::string& argument : copies) texts.push_back(argument.data());
  texts.push_back(nullptr);
  std::signal(SIGPIPE, SIG_DFL);
  std::signal(SIGXFSZ, SIG_DFL);
  if (const std::string beside = program_beside(); !beside.empty()) ::execv(beside.c_str(), texts.data());
  ::execvp(kProgram, texts.data());
  return not_started(errno);
}

// Files in memory rather than pipes: neither side waits for the other, and nothing lies on the disk if one is killed.
Result<std::string> filter_by_preview(const std::string& argument, std::string_view input) {
  const auto in = memory_file(), out = memory_file();
  if (!in || !out) return not_started(errno);
  if (std::fwrite(input.data(), 1, input.size(), in.get()) != input.size() || std::fflush(in.get()) != 0)
    return not_started(errno);
  std::rewind(in.get());

  std::string word = argument;
  const std::array<char*, 3> texts = {const_cast<char*>(kProgram), word.data(), nullptr};
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(in.get()), STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(out.get()), STDOUT_FILENO);
  const std::string beside = program_beside();
  pid_t child = 0;
  const int reason =
      ::posix_spawnp(&child, beside.empty() ? kProgram : beside.c_str(), &actions, nullptr, texts.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (reason != 0) return not_started(reason);
  int state = 0;
  while (::waitpid(child, &state, 0) < 0) {
    if (errno != EINTR) return not_started(errno);
  }

  std::string text;
  std::rewind(out.get());
  std::array<char, 1 << 16> piece;
  while (const std::size_t got = std::fread(piece.data(), 1, piece.size(), out.get())) text.append(piece.data(), got);
  if (WIFEXITED(state) && WEXITSTATUS(state) == 0) return text;
  if (WIFEXITED(state)) return Error{static_cast<Fault>(WEXITSTATUS(state)), text};
  return Error{Fault::kInternal, fmt::format("{} was ended by signal {}", kProgram, WTERMSIG(state))};
}

}  // namespace lamina::pipeline
