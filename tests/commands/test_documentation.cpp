// The documentation and the definitions of the command line say the same.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <set>
#include <sstream>

#include "pipeline/cli/command.h"
#include "pipeline/cli/terminal/pages.h"
#include "pipeline/machine/profiles.h"
#include "stages/support/text/number_text.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = fs::path(LAMINA_TEST_DIR).parent_path();

std::set<std::string> long_flags(const pipeline::CommandSpec& spec) {
  std::set<std::string> flags;
  for (const pipeline::OptionSpec& option : spec.options) {
    for (const std::string_view flag : split(option.flag, ",")) {
      if (flag.starts_with("--")) flags.emplace(flag);
    }
  }
  return flags;
}

std::vector<fs::path> pages() {
  std::vector<fs::path> found = {kRoot / "README.md"};
  for (const auto& entry : fs::recursive_directory_iterator(kRoot / "docs")) {
    if (entry.path().extension() == ".md") found.push_back(entry.path());
  }
  return found;
}

// docs/reference/commands is what the definitions give: lamina manual --markdown -o docs/reference/commands.
TEST(Documentation, PagesOfCommandsAreThoseOfTheirDefinitions) {
  std::set<std::string> pages;
  for (const auto& entry : fs::directory_iterator(kRoot / "docs/reference/commands")) pages.insert(entry.path().filename());
  for (const pipeline::Command* command : pipeline::commands()) {
    const std::string name = std::string(command->name) + ".md";
    ASSERT_EQ(pages.erase(name), 1u) << name;
    EXPECT_EQ(read_text(kRoot / "docs/reference/commands" / name), pipeline::markdown_page(pipeline::spec_of(*command)))
        << name;
    const std::string readme = read_text(kRoot / "README.md");
    EXPECT_NE(readme.find("commands/" + std::string(command->name) + ".md"), std::string::npos) << command->name;
  }
  EXPECT_TRUE(pages.empty()) << "docs/reference/commands/" << *pages.begin() << " is of no command";
}

// What the commands' own programs take is what their definitions say: lamina preview is one of its own.
TEST(Documentation, PreviewTakesTheOptionsOfItsDefinition) {
  const Directory directory;
  const Outcome outcome = run_lamina({"preview", "--help"}, directory.path());
  ASSERT_EQ(outcome.code, 0);
  for (const std::string& flag : long_flags(pipeline::spec_of(pipeline::preview_command)))
    EXPECT_NE(outcome.out.find(flag), std::string::npos) << flag;
}

// Every --option that a page puts between backticks is one of some command, or of another program that it names.
TEST(Documentation, EveryOptionThatItNamesExists) {
  std::set<std::string> known = {"--help", "--help-all", "--version"};
  for (const pipeline::Command* command : pipeline::commands()) known.merge(long_flags(pipeline::spec_of(*command)));
  const std::set<std::string> others = {"--install",    "--export-sla", "--export-svg",     "--sanitize",
                                        "--models",     "--bench",      "--develop",        "--infill",
                                        "--perimeters", "--wall-loops", "--wall-line-count"};
  const std::regex quoted("`[^`\n]*`"), flag("(?:^|[ `(])(--[a-z][a-z0-9-]*)");
  std::size_t checked = 0;
  for (const fs::path& page : pages()) {
    const std::string text = read_text(page);
    for (std::sregex_iterator at(text.begin(), text.end(), quoted), end; at != end; ++at) {
      const std::string words = at->str();
      for (std::sregex_iterator word(words.begin(), words.end(), flag); word != end; ++word) {
        const std::string name = (*word)[1];
        EXPECT_TRUE(known.contains(name) || others.contains(name)) << page.filename() << ": " << name;
        ++checked;
      }
    }
  }
  EXPECT_GT(checked, 100u);
}

// Every key of a machine's profile, with the default that it has.
TEST(Documentation, EveryKeyOfAMachineIsDocumented) {
  const std::string page = read_text(kRoot / "docs/reference/machines.md");
  std::string section;
  std::istringstream profile(pipeline::machine_text(Machine()));
  std::size_t checked = 0;
  for (std::string line; std::getline(profile, line);) {
    if (line.starts_with('[')) section = line.substr(1, line.find(']') - 1);
    const std::size_t equals = line.find(" = ");
    if (equals == std::string::npos || line.starts_with('#')) continue;
    const std::string name = line.substr(0, equals), value = line.substr(equals + 3);
    const std::regex row("\\| `" + section + "\\.[^\n]*`?\\.?" + name + "`[^\n]*");
    std::smatch found;
    ASSERT_TRUE(std::regex_search(page, found, row)) << section << "." << name;
    EXPECT_TRUE(value == "\"\"" || found.str().find(value) != std::string::npos)
        << section << "." << name << " is " << value << ": " << found.str();
    ++checked;
  }
  EXPECT_GT(checked, 40u);
}

// The text after "lamina COMMAND" on a line, up to what ends a command there.
TEST(Documentation, EveryCommandLineInItCanBeTyped) {
  const std::regex line("(?:^|[^-/a-z])lamina ([a-z]+)((?: [^\\n`|;&#()]*)?)", std::regex::multiline),
      flag("(?:^| )(--[a-z][a-z0-9-]*)");
  std::size_t checked = 0;
  for (const fs::path& page : pages()) {
    const std::string text = read_text(page);
    for (std::sregex_iterator at(text.begin(), text.end(), line), end; at != end; ++at) {
      const pipeline::Command* command = pipeline::find_command((*at)[1].str());
      const std::string rest = (*at)[2];
      const bool typed = std::regex_search(rest, flag);  // else it may be a sentence: "lamina plans ..."
      if (!typed) continue;
      ASSERT_NE(command, nullptr) << page.filename() << ": " << at->str();
      const pipeline::CommandSpec spec = pipeline::spec_of(*command);
      // What stands in quotes is for another command, as in --with 'jet --dpi 600'.
      const std::string bare = std::regex_replace(rest, std::regex("'[^']*'"), "");
      for (std::sregex_iterator word(bare.begin(), bare.end(), flag); word != end; ++word) {
        const std::string name = (*word)[1];
        EXPECT_TRUE(name == "--help" || name == "--help-all" || long_flags(spec).contains(name))
            << page.filename() << ": " << at->str() << ": " << name;
        ++checked;
      }
    }
  }
  EXPECT_GT(checked, 10u);
}

// Wrong options (2) and bad parts (3) fail in every share and every time.
TEST(Documentation, KubernetesDoesNotTryAgainWhatCannotSucceed) {
  const std::string page = read_text(kRoot / "scripts/cluster/kubernetes_jet.yaml");
  const std::regex rule("action: FailJob\\s+onExitCodes: \\{containerName: (share|merge), operator: In, values: \\[2, 3[,\\]]");
  EXPECT_EQ(std::distance(std::sregex_iterator(page.begin(), page.end(), rule), std::sregex_iterator()), 2);
  EXPECT_NE(read_text(kRoot / "scripts/cluster/Containerfile").find("lamina"), std::string::npos);
}

}  // namespace
}  // namespace lamina::test
