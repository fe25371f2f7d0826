// lamina completion and lamina manual.
#include <fmt/format.h>

#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/cli/terminal/pages.h"
#include "pipeline/job/errors.h"
#include "stages/support/io/file.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec completion_spec() {
  CommandSpec spec;
  spec.summary = "Prints a shell script that completes commands, options and values of lamina. Packages install it already.";
  spec.operand = "SHELL";
  spec.operand_meaning = "bash, zsh or fish";
  spec.operand_words = {"bash", "zsh", "fish"};
  spec.closing =
      "Examples:\n"
      "  lamina completion bash > ~/.local/share/bash-completion/completions/lamina\n"
      "  lamina completion zsh > ~/.zfunc/_lamina\n"
      "  lamina completion fish > ~/.config/fish/completions/lamina.fish";
  return spec;
}

Outcome run_completion(const Arguments& arguments, Context& context) {
  const std::string shell = arguments.operands.size() == 1 ? arguments.operands.front() : "";
  if (shell == "bash") return context.print(bash_completion(all_specs()));
  if (shell == "zsh") return context.print(zsh_completion(all_specs()));
  if (shell == "fish") return context.print(fish_completion(all_specs()));
  return usage("name one shell: bash, zsh or fish");
}

CommandSpec manual_spec() {
  CommandSpec spec;
  spec.summary = "Prints the manual page of lamina or of one of its commands, in the format of man.";
  spec.operand = "COMMAND";
  spec.operand_meaning = "a command; default: the page of lamina";
  for (const Command* command : commands()) spec.operand_words.push_back(command->name);
  spec.options = {{"-o,--output", "DIR", "output directory for the pages of all commands", "", ""},
                  {"--markdown", "", "write Markdown, as in docs/reference/commands", "", ""},
                  {"--overwrite", "", "replace a file that lamina did not write", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina manual jet | man -l -\n"
      "  lamina manual --markdown -o docs/reference/commands";
  return spec;
}

std::string page_of(const CommandSpec& spec, bool markdown) { return markdown ? markdown_page(spec) : man_page(spec); }

/// Writes all pages, or none if one would replace a user's file.
Status write_pages(const std::string& directory, bool markdown, bool overwrite) {
  std::vector<std::pair<std::string, std::string>> pages;  // path, text
  const std::vector<CommandSpec> specs = all_specs();
  if (!markdown) pages.emplace_back(fmt::format("{}/lamina.1", directory), man_page(specs));
  for (const CommandSpec& spec : specs) {
    pages.emplace_back(fmt::format("{}/{}{}{}", directory, markdown ? "" : "lamina-", spec.name, markdown ? ".md" : ".1"),
                       page_of(spec, markdown));
  }
  constexpr std::string_view kMarks[] = {"\"lamina ", "lamina manual --markdown"};
  for (const auto& [path, text] : pages) {
    if (Status status = check_own_file(path, kMarks); !status && !overwrite) return status;
  }
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) return failure(Fault::kOutput, "{}: {}", directory, error.message());
  for (const auto& [path, text] : pages) {
    if (Status status = write_file(path, text); !status) return status;
  }
  return {};
}

Outcome run_manual(const Arguments& arguments, Context& context) {
  const bool markdown = arguments.has("--markdown");
  if (arguments.operands.size() > 1) return usage("name one command, or -o DIR for the pages of all");
  if (arguments.has("-o,--output") && !arguments.operands.empty()) {
    return at_option("--output", fmt::format("is for the pages of all commands; leave out '{}', or print that page to a file",
                                             one_line(arguments.operands.front())));
  }
  if (arguments.has("-o,--output")) return write_pages(arguments.text("-o,--output"), markdown, arguments.has("--overwrite"));
  if (arguments.operands.empty()) {
    if (markdown) return usage("--markdown: name a command, or -o DIR for all of them");
    return context.print(man_page(all_specs()));
  }
  const Command* command = find_command(arguments.operands.front());
  if (command == nullptr) return Error{Fault::kUsage, unknown_command(arguments.operands.front())};
  return context.print(page_of(spec_of(*command), markdown));
}

}  // namespace

const Command completion_command = {"completion", "print the completion script of a shell", completion_spec, run_completion};
const Command manual_command = {"manual", "print or write the manual pages", manual_spec, run_manual};

}  // namespace lamina::pipeline
