#include "pipeline/cli/help/help.h"

#include <fmt/format.h>

#include <string_view>

#include "pipeline/text/number_text.h"

namespace lamina::pipeline {
namespace {

std::string replaced(std::string_view text, char what, std::string_view by) {
  std::string out;
  for (const char c : text) c == what ? out.append(by) : out.append(1, c);
  return out;
}

}  // namespace

std::string fish_completion() {
  const auto quoted = [](std::string_view text) { return "'" + replaced(replaced(text, '\\', "\\\\"), '\'', "\\'") + "'"; };
  std::string text = "# fish completion for lamina, made by: lamina completion fish\n";
  for (const Command* command : commands()) {
    text +=
        fmt::format("complete -c lamina -n __fish_use_subcommand -f -a {} -d {}\n", command->name, quoted(command->summary));
    for (const OptionSpec& option : spec_of(*command).options) {
      text += fmt::format("complete -c lamina -n '__fish_seen_subcommand_from {}'", command->name);
      for (const std::string_view flag : split(option.flag, ",")) {
        text += flag.starts_with("--") ? fmt::format(" -l {}", flag.substr(2)) : fmt::format(" -s {}", flag.substr(1));
      }
      text += fmt::format("{} -d {}\n", option.value.empty() ? "" : " -r", quoted(option.meaning));
    }
  }
  return text;
}

}  // namespace lamina::pipeline
