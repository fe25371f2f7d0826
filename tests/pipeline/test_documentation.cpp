// The documentation and the definitions of the command line say the same.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <set>

#include "pipeline/command_line.h"
#include "pipeline/number_text.h"
#include "program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = fs::path(LAMINA_TEST_DIR).parent_path();

/// Whether one of the names of an option is among the words.
bool named(const pipeline::OptionSpec& option, const std::set<std::string>& words) {
  const auto flags = pipeline::split(option.flag, ",");
  return std::ranges::any_of(flags, [&](std::string_view flag) { return words.contains(std::string(flag)); });
}

std::set<std::string> long_flags(const pipeline::CommandSpec& spec) {
  std::set<std::string> flags;
  for (const pipeline::OptionSpec& option : spec.options) {
    for (const std::string_view flag : pipeline::split(option.flag, ",")) {
      if (flag.starts_with("--")) flags.emplace(flag);
    }
  }
  return flags;
}

std::vector<fs::path> pages() {
  std::vector<fs::path> found = {kRoot / "README.md"};
  for (const auto& entry : fs::directory_iterator(kRoot / "docs")) {
    if (entry.path().extension() == ".md") found.push_back(entry.path());
  }
  return found;
}

// Commands and the page that has to name each of their options.
TEST(Documentation, PagesOfCommandsNameEveryOption) {
  const std::regex flag("--?[a-z][a-z0-9-]*");
  for (const auto& [name, page] : {std::pair{"batch", "batch.md"}, {"report", "report.md"}, {"manual", "install.md"},
                                   {"completion", "install.md"}}) {
    const std::string text = read_text(kRoot / "docs" / page);
    std::set<std::string> words;
    for (std::sregex_iterator at(text.begin(), text.end(), flag), end; at != end; ++at) words.insert(at->str());
    EXPECT_NE(text.find("lamina " + std::string(name)), std::string::npos) << name;
    const pipeline::Command* found = pipeline::find_command(name);
    ASSERT_NE(found, nullptr) << name;
    const pipeline::Command& command = *found;
    const pipeline::CommandSpec spec = pipeline::spec_of(command);
    EXPECT_EQ(spec.name, name);
    for (const pipeline::OptionSpec& option : spec.options) EXPECT_TRUE(named(option, words)) << command.name << " " << option.flag;
  }
}

// Whatever stands behind "lamina COMMAND" on a line, up to what ends a command there.
TEST(Documentation, EveryCommandLineInItCanBeTyped) {
  const std::regex line("(?:^|[^-/a-z])lamina ([a-z]+)((?: [^\\n`|;&#()]*)?)", std::regex::multiline), flag("(?:^| )(--[a-z][a-z0-9-]*)");
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
      if (spec.name.empty()) continue;
      // What stands in quotes is for another command, as in --with 'jet --dpi 600'.
      const std::string bare = std::regex_replace(rest, std::regex("'[^']*'"), "");
      for (std::sregex_iterator word(bare.begin(), bare.end(), flag); word != end; ++word) {
        const std::string name = (*word)[1];
        EXPECT_TRUE(name == "--help" || long_flags(spec).contains(name)) << page.filename() << ": " << at->str() << ": " << name;
        ++checked;
      }
    }
  }
  EXPECT_GT(checked, 10u);
}

}  // namespace
}  // namespace lamina::test
