#include "stages/support/io/other_program.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>

#include "stages/data/shortage.h"
#include "stages/support/io/file.h"

namespace lamina {
namespace {

Error not_started(const std::string& program, int reason) {
  if (is_shortage(reason)) return shortage(reason, program);
  const bool absent = reason == ENOENT || reason == EACCES || reason == ELIBACC || reason == ENOTDIR || reason == ENOEXEC;
  return {absent             ? Fault::kUsage
          : reason == EAGAIN ? Fault::kMemory
                             : Fault::kInternal,
          fmt::format("{}: {}; install the Debian package {}, or put the program next to lamina or in PATH", program,
                      std::strerror(reason), program)};
}

/// OpenImageIO and OpenCV name some hundred libraries, whose constructors end the program if memory runs out.
/// errors  kMemory: the limit on address space is below what they take in Debian 12
Status check_address_space(const std::string& program) {
  constexpr rlim_t kNeeded = 450;  // MiB
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur >= kNeeded << 20) return {};
  return Error{
      Fault::kMemory,
      fmt::format("{}: out of memory: needs more than {} MiB of address space; raise the limit (ulimit -v)", program, kNeeded)};
}

/// The program in this one's folder, or its name for PATH.
std::string find_program(const std::string& program) {
  std::error_code error;
  const char* const launcher = std::getenv("LAMINA_PROGRAM");  // of the portable archive (packaging/launcher.c)
  const std::filesystem::path own = launcher != nullptr ? launcher : std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path neighbour = own.parent_path() / program;
  return !error && std::filesystem::exists(neighbour, error) ? neighbour.string() : program;
}

/// A file in memory that no folder shows.
std::unique_ptr<std::FILE, int (*)(std::FILE*)> memory_file(const std::string& name) {
  const int file = ::memfd_create(name.c_str(), MFD_CLOEXEC);
  return {file < 0 ? nullptr : ::fdopen(file, "w+"), &std::fclose};
}

}  // namespace

Error hand_over(const std::string& program, const std::vector<std::string>& arguments) {
  if (const Status enough = check_address_space(program); !enough) return enough.error();
  std::vector<std::string> copies = arguments;
  std::vector<char*> texts = {const_cast<char*>(program.c_str())};
  for (std::string& argument : copies) texts.push_back(argument.data());
  texts.push_back(nullptr);
  std::signal(SIGPIPE, SIG_DFL);
  std::signal(SIGXFSZ, SIG_DFL);
  ::execvp(find_program(program).c_str(), texts.data());
  ::execvp(program.c_str(), texts.data());
  return not_started(program, errno);
}

// Files in memory rather than pipes: neither side waits for the other, and nothing lies on the disk if one is killed.
Result<std::string> filter(const std::string& program, const std::string& argument, std::string_view input) {
  if (const Status enough = check_address_space(program); !enough) return enough.error();
  const auto in = memory_file(program), out = memory_file(program);
  if (!in || !out) return not_started(program, errno);
  if (std::fwrite(input.data(), 1, input.size(), in.get()) != input.size() || std::fflush(in.get()) != 0)
    return write_failure("what " + program + " is to read", errno);  // a limit on file sizes holds in memory too
  std::rewind(in.get());

  std::string word = argument;
  const std::array<char*, 3> texts = {const_cast<char*>(program.c_str()), word.data(), nullptr};
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(in.get()), STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(out.get()), STDOUT_FILENO);
  pid_t child = 0;
  const int reason = ::posix_spawnp(&child, find_program(program).c_str(), &actions, nullptr, texts.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (reason != 0) return not_started(program, reason);
  int state = 0;
  while (::waitpid(child, &state, 0) < 0) {
    if (errno != EINTR) return not_started(program, errno);
  }

  std::string text;
  std::rewind(out.get());
  std::array<char, 1 << 16> piece;
  while (const std::size_t got = std::fread(piece.data(), 1, piece.size(), out.get())) text.append(piece.data(), got);
  if (WIFEXITED(state) && WEXITSTATUS(state) == 0) return text;
  constexpr int kNotLoaded = 127;  // of the dynamic linker
  if (WIFEXITED(state) && WEXITSTATUS(state) == kNotLoaded) return not_started(program, ELIBACC);
  if (WIFEXITED(state) && text.empty()) text = fmt::format("{} could not report its result", program);
  if (WIFEXITED(state)) return Error{static_cast<Fault>(WEXITSTATUS(state)), text};
  return Error{Fault::kInternal, fmt::format("{} was ended by signal {}", program, WTERMSIG(state))};
}

}  // namespace lamina
