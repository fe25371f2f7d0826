#include "pipeline/cli/command.h"
#include "pipeline/cli/help/help.h"

namespace lamina::pipeline {
namespace {

CommandSpec completion_spec() {
  CommandSpec spec;
  spec.summary = "Prints what makes a shell complete the commands and options of lamina; packages install it already.";
  spec.operand = "SHELL";
  spec.operand_meaning = "bash, zsh or fish";
  spec.closing =
      "Examples:\n"
      "  lamina completion bash > ~/.local/share/bash-completion/completions/lamina\n"
      "  lamina completion zsh > ~/.zfunc/_lamina\n"
      "  lamina completion fish > ~/.config/fish/completions/lamina.fish";
  return spec;
}

Outcome run_completion(const Arguments& arguments, Context& context) {
  const std::string shell = arguments.operands.size() == 1 ? arguments.operands.front() : "";
  if (shell == "bash") return context.print(bash_completion());
  if (shell == "zsh") return context.print(zsh_completion());
  if (shell == "fish") return context.print(fish_completion());
  return Error{Fault::kUsage, "name one shell: bash, zsh or fish"};
}

}  // namespace

const Command completion_command = {"completion", "makes a shell complete commands and options", completion_spec,
                                    run_completion};

}  // namespace lamina::pipeline
