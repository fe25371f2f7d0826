#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>

#include "pipeline/command_line.h"
#include "pipeline/console.h"

namespace lamina::pipeline {

// Pictures need libraries that no job should have to load: they are made by a program of its own.
int run_preview_command(const std::vector<std::string>& arguments) {
  constexpr const char* kProgram = "lamina-preview";
  std::vector<char*> texts;
  std::string name = kProgram;
  texts.push_back(name.data());
  std::vector<std::string> copies = arguments;
  for (std::string& argument : copies) texts.push_back(argument.data());
  texts.push_back(nullptr);

  std::error_code error;
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe", error);
  std::signal(SIGPIPE, SIG_DFL);
  std::signal(SIGXFSZ, SIG_DFL);
  if (!error) ::execv((own.parent_path() / kProgram).c_str(), texts.data());
  ::execvp(kProgram, texts.data());
  return fail({Fault::kInternal, fmt::format("{}: {}; it belongs beside lamina or into PATH, install it there", kProgram,
                                             std::strerror(errno))});
}

}  // namespace lamina::pipeline
