// What a person types, and what the program says of itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <sstream>

#include "pipeline/cli/command.h"
#include "pipeline/cli/terminal/arguments.h"
#include "pipeline/cli/terminal/pages.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

TEST(Help, IsAsWideAsTheTerminalAndNamesEveryOption) {
  for (CommandSpec spec : pipeline::all_specs()) {
    spec.closing.clear();  // examples stay as they are
    spec.more = nullptr;
    for (const int columns : {40, 60, 100}) {
      std::istringstream lines(help_text(spec, columns, HelpLength::kAll));
      for (std::string line; std::getline(lines, line);) {
        const bool one_word = line.find(' ', line.find_first_not_of(' ')) == std::string::npos;
        const bool a_term = line.starts_with("  -") || line.starts_with("Usage");
        EXPECT_TRUE(line.size() <= static_cast<std::size_t>(columns) || one_word || a_term ||
                    line.find("(default ") != line.npos)
            << spec.name << ", " << columns << ": " << line;
      }
    }
    const std::string text = help_text(spec, 100, HelpLength::kAll);
    for (const OptionSpec& option : spec.options) {
      EXPECT_NE(text.find(option.flag.substr(option.flag.rfind(',') + 1)), std::string::npos) << spec.name << option.flag;
    }
    EXPECT_EQ(text.find("\n\n\n"), std::string::npos) << spec.name;
    EXPECT_EQ(text.find('\1'), std::string::npos) << spec.name;
  }
}

TEST(Help, OfCommandsThatPlanIsShortAndNamesTheRest) {
  for (const std::string name : {"jet", "slice", "extrude"}) {
    const CommandSpec spec = spec_of(*find_command(name));
    EXPECT_GE(spec.basic.size(), 15u) << name;
    EXPECT_LE(spec.basic.size(), 20u) << name;
    for (const std::string_view flag : spec.basic) ASSERT_NE(spec.find(flag), nullptr) << name << ": " << flag;
    const std::string text = help_text(spec, 80, HelpLength::kShort);
    EXPECT_LE(std::ranges::count(text, '\n'), 60) << name << ", 80 columns:\n" << text;
    for (const std::string_view flag : spec.basic) EXPECT_NE(text.find(flag), std::string::npos) << name << ": " << flag;
    EXPECT_NE(text.find("--help-all"), std::string::npos) << name;
    EXPECT_NE(text.find("\nExamples:\n  lamina " + name), std::string::npos) << text;
    EXPECT_EQ(text.find("\n\n\n"), std::string::npos) << text;
  }
}

TEST(Help, HasEachHeadingOnce) {
  for (CommandSpec spec : pipeline::all_specs()) {
    spec.summary.clear();
    spec.closing.clear();
    spec.more = nullptr;
    std::multiset<std::string> headings;
    std::istringstream lines(help_text(spec, 100, HelpLength::kAll) + man_page(spec) + markdown_page(spec));
    for (std::string line; std::getline(lines, line);) {
      const bool of_help = !line.starts_with(' ') && line.ends_with(':');
      if (of_help || line.starts_with(".SS ") || line.starts_with("## ")) headings.insert(line);
    }
    for (const std::string& heading : headings) EXPECT_EQ(headings.count(heading), 1u) << spec.name << ": " << heading;
    EXPECT_TRUE(headings.contains("Options:")) << spec.name;
    if (spec.name == "jet") {
      EXPECT_TRUE(headings.contains("Machine and binder:"));
    }
    if (spec.name == "extrude") {
      EXPECT_TRUE(headings.contains("Machine:"));
      EXPECT_FALSE(headings.contains("Machine and binder:"));
    }
  }
}

TEST(Manual, EveryPageSaysWhereFilesLieAndWhatTheEnvironmentDoes) {
  const auto specs = pipeline::all_specs();
  EXPECT_NE(man_page(specs).find("SOURCE_DATE_EPOCH"), std::string::npos);
  for (const CommandSpec& spec : specs) {
    const std::string page = man_page(spec);
    for (const char* heading : {".SH FILES\n", ".SH ENVIRONMENT\n", ".SH EXIT STATUS\n"}) {
      EXPECT_NE(page.find(heading), std::string::npos) << spec.name << heading;
    }
  }
}

TEST(SlicerAliases, OfOtherSlicersAreAnsweredWithOurs) {
  const auto requested = [](const char* command, const char* flag) {
    return slicer_alias(flag, pipeline::spec_of(*pipeline::find_command(command)));
  };
  const struct {
    const char *command, *flag, *ours;
  } rows[] = {
      {"extrude", "--layer_height", "'--layer'"},
      {"extrude", "--wall_line_count", "'--walls'"},
      {"extrude", "--fill-density", "'--density'"},
      {"extrude", "--infill-pattern", "'--pattern'"},
      {"jet", "--resolution", "'--dpi'"},
      {"slice", "--resolution", "'--tolerance'"},
      {"extrude", "--temperature", "'--nozzle-temperature'"},
      {"jet", "--duplicate", "'--copies'"},
      {"extrude", "--rotate-x", "'--rotate'"},
      {"extrude", "--support", "lamina makes no supports"},
      {"jet", "--support_material", "lamina makes no supports"},
      {"extrude", "--brim-width", "'--brim'"},
      {"extrude", "--raft-layers", "'--raft'"},
  };
  for (const auto& row : rows) EXPECT_NE(requested(row.command, row.flag).find(row.ours), std::string::npos) << row.flag;
  EXPECT_EQ(requested("info", "--layer-height"), "") << "info has no layers";
  EXPECT_EQ(requested("jet", "--dip"), "");
}

TEST(SlicerAliases, WithOurMeaningAreAcceptedUnderOurName) {
  const auto spec = pipeline::spec_of(*pipeline::find_command("extrude"));
  const auto read =
      read_arguments(spec, {"part.stl", "--layer-height=0.2", "--perimeters", "3", "--infill", "30", "--wall-loops", "2"});
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->text("--layer"), "0.2");
  EXPECT_EQ(read->all("--walls"), (std::vector<std::string>{"3", "2"}));
  EXPECT_EQ(read->text("--density"), "30");
  const auto empty = read_arguments(spec, {"part.stl", "--layer-height", "--quiet"});
  ASSERT_FALSE(empty);
  EXPECT_EQ(empty.error().message.substr(0, 28), "--layer: needs a value, MM, ");
  const auto refused = [&](const std::vector<std::string>& words) { return read_arguments(spec, words).error().message; };
  EXPECT_EQ(refused({"part.stl", "--thread", "2"}), "--thread: no such option; did you mean '--threads'?");
  EXPECT_EQ(refused({"part.stl", "-o", "--resume"}).substr(0, 34), "--output: needs a value, FILE, bef");
  EXPECT_EQ(refused({"part.stl", "--wall_loops", "2"}), "--wall_loops: no such option; did you mean '--walls'?");
  // One documented name: help and completion have ours alone; commands without ours refuse theirs.
  EXPECT_EQ(help_text(spec, 100, HelpLength::kAll).find("--perimeters"), std::string::npos);
  EXPECT_FALSE(read_arguments(pipeline::spec_of(*pipeline::find_command("info")), {"--layer-height", "0.2"}));
}

TEST(ArgumentReaders, NoCallDependsOnAnEarlierOne) {
  const std::vector<std::vector<std::string>> calls = {{"a.stl", "b.stl", "--layer", "0.2", "--dry-run", "-o", "out"},
                                                       {},
                                                       {"c.stl", "--set", "bed.dpi=300", "--set", "run.sync=off"},
                                                       {"--layer"},
                                                       {"d.stl", "--no-such-option"},
                                                       {"-o", "--resume"},
                                                       {"--help"},
                                                       {"--layer-height=0.3", "--", "-e.stl"},
                                                       {"a.stl", "--set", "bed.dpi=600"}};
  for (const std::string name : {"jet", "extrude", "info", "merge"}) {
    const CommandSpec spec = spec_of(*find_command(name));
    ArgumentReader reader(spec);
    for (std::size_t i = 0; i < 3 * calls.size(); ++i) {
      const auto& call = calls[i * 5 % calls.size()];
      const auto again = reader.read(call), once = read_arguments(spec, call);
      ASSERT_EQ(again.ok(), once.ok()) << name << ", call " << i;
      if (!once) {
        EXPECT_EQ(again.error().message, once.error().message);
        continue;
      }
      EXPECT_EQ(again->options, once->options) << name << ", call " << i;
      EXPECT_EQ(again->operands, once->operands) << name << ", call " << i;
      EXPECT_EQ(again->given, once->given);
      EXPECT_EQ(again->help, once->help);
    }
  }
}

TEST(Suggestions, TheShorterOfTwoNamesThatHoldTheWordIsNearer) {
  const std::vector<std::string_view> names = {"nuferbj-31", "nuferbj-360dpi", "nuferbj"};
  EXPECT_EQ(suggest("nuferb", names), "; did you mean 'nuferbj'?");
  EXPECT_EQ(suggest("360dpi", names), "; did you mean 'nuferbj-360dpi'?");
}

TEST(Suggestions, AThirdOfTheLettersMayBeWrong) {
  const std::vector<std::string_view> names = {"--skirt", "--walls", "--nozzle-temperature", "--at", "-o"};
  EXPECT_EQ(suggest("--support", names), "");
  EXPECT_EQ(suggest("--raft", names), "");
  EXPECT_EQ(suggest("--wall", names), "; did you mean '--walls'?");
  EXPECT_EQ(suggest("--skrit", names), "; did you mean '--skirt'?");
  EXPECT_EQ(suggest("--wlals", names), "; did you mean '--walls'?");
  EXPECT_EQ(suggest("--nozle-temprature", names), "; did you mean '--nozzle-temperature'?");
  EXPECT_EQ(suggest("--zzz", names), "");
}

}  // namespace
}  // namespace lamina::pipeline
