// pipeline/job/job_command.h: the comment at the top of a saved job that names the command which runs it.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>

namespace lamina::pipeline {

inline constexpr std::string_view kJobCommandBefore = "# A job of lamina. Run it with: lamina ", kJobCommandAfter = " --job ";

/// The line, without its end, of a job that `command` runs.
inline std::string job_command_line(std::string_view command) {
  return std::string(kJobCommandBefore).append(command).append(kJobCommandAfter).append("FILE");
}

/// The command that a line names: one word of lower-case letters, which may be no command; "" for any other line.
inline std::string_view command_in(std::string_view line) {
  if (!line.starts_with(kJobCommandBefore)) return {};
  line.remove_prefix(kJobCommandBefore.size());
  const std::string_view word = line.substr(0, line.find(' '));
  const bool is_word = !word.empty() && std::ranges::all_of(word, [](char c) { return 'a' <= c && c <= 'z'; });
  return is_word && line.substr(word.size()).starts_with(kJobCommandAfter) ? word : std::string_view();
}

}  // namespace lamina::pipeline
