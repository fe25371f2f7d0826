// Messages for users and scripts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "pipeline/cli/console.h"
#include "pipeline/report/summary.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using test::Directory;
using test::Outcome;
using test::run_lamina;

TEST(JsonText, EveryByteSequenceIsJsonAndUtf8StaysAsItIs) {
  for (int first = 0; first < 256; ++first) {
    for (const int second : {0x00, 0x22, 0x41, 0x5c, 0x80, 0x9f, 0xa0, 0xbf, 0xc0, 0xff}) {
      const std::string text = {static_cast<char>(first), static_cast<char>(second), 'x'};
      const auto json = nlohmann::json::parse(json_string(text), nullptr, false);
      ASSERT_FALSE(json.is_discarded()) << first << ' ' << second;
      if (is_utf8(text)) {
        EXPECT_EQ(json.get<std::string>(), text);
      }
      // Bytes that are replaced are replaced once: what is read back is written the same.
      EXPECT_EQ(json_string(json.get<std::string>()), json_string(text));
    }
  }
  EXPECT_TRUE(is_utf8("\xe2\x82\xac \xf0\x9f\x98\x80"));
  for (const char* bad : {"\xc0\xaf", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xe2\x82", "\x80", "\xe0\x80\x80"})
    EXPECT_FALSE(is_utf8(bad));
  EXPECT_EQ(one_line("a\r\nb\x1b[31mc\n"), "a b [31mc");
}

TEST(Console, NumbersAreReadable) {
  EXPECT_EQ(readable_bytes(999), "999 B");
  EXPECT_EQ(readable_bytes(1'500'000'000), "1.50 GB");
  EXPECT_EQ(readable_count(1'234'567), "1 234 567");
  EXPECT_EQ(readable_count(123), "123");
  EXPECT_EQ(readable_seconds(0.0123), "0.012 s");
  EXPECT_EQ(readable_seconds(200), "3 min 20 s");
  EXPECT_EQ(readable_seconds(7500), "2 h 05 min");
}

TEST(Summary, JsonHoldsWhatTheTextReports) {
  Summary summary;
  summary.output = "a \"b\"";
  summary.layers_total = summary.layers_planned = 1'234'567;
  summary.parts.resize(1);
  summary.parts[0].path = "p.stl";
  summary.parts[0].bounds = {{0, 0, 0}, {1'000'000, 2'000'000, 3'000'000}};
  summary.parts[0].notes = {{true, "one hole closed"}};
  summary.warnings = {{"volume", "first\nwarning"}, {"part-lost", "second", "part.stl", 7, 0.5}};
  const auto json = nlohmann::json::parse(summary.json());
  EXPECT_EQ(json["output"], "a \"b\"");
  EXPECT_EQ(json["layers_total"], 1'234'567);
  EXPECT_EQ(json["warnings"].size(), 2u);
  EXPECT_EQ(json["layers_per_second"], 0) << "no time is no rate, and never inf, which JSON does not have";
  const std::string text = summary.text();
  for (const char* words : {"1 234 567", "1.000 x 2.000 x 3.000 mm", "repair: one hole closed", "first warning", "second"}) {
    EXPECT_NE(text.find(words), std::string::npos) << words << "\n" << text;
  }
}

TEST(Help, EveryCommandTeachesWithExamplesAndNamesEveryOption) {
  const Directory directory;
  for (const std::string command : {"jet", "info", "verify", "merge"}) {
    const Outcome help = run_lamina({command, "--help"}, directory.path());
    EXPECT_EQ(help.code, 0);
    EXPECT_EQ(help.err, "");
    EXPECT_NE(help.out.find("Examples:\n  "), std::string::npos);
    EXPECT_NE(help.out.find("lamina " + command), std::string::npos);
    EXPECT_EQ(run_lamina({"help", command}, directory.path()).out, help.out);
  }
  EXPECT_EQ(run_lamina({"help", "jett"}, directory.path()).code, 2);
  EXPECT_EQ(run_lamina({"help", "jet", "slice"}, directory.path()).code, 2);
  const std::string jet = run_lamina({"jet", "--help-all"}, directory.path()).out;
  for (const char* flag :
       {"--job",    "--save-job", "--set",       "--bed",      "--dpi",    "--layer",  "--copies",    "--at",
        "--gap",    "--scale",    "--rotate",    "--shrink",   "--unit",   "--engine", "--fill",      "--format",
        "--mirror", "--layers",   "--shard",     "--threads",  "--memory", "--resume", "--overwrite", "--dry-run",
        "--json",   "--quiet",    "--no-repair", "--drop-bad", "--weld"}) {
    EXPECT_NE(jet.find(flag), std::string::npos) << flag;
  }
  EXPECT_NE(jet.find("(default 490x380)"), std::string::npos);
  EXPECT_EQ(run_lamina({"--version"}, directory.path()).out.substr(0, 7), "lamina ");
  const Outcome bare = run_lamina({}, directory.path());
  EXPECT_EQ(bare.code, 2);
  EXPECT_NE(bare.err.find("Commands:"), std::string::npos);
}

TEST(PreviewCommand, HandsAllArgumentsAndTheExitCodeToTheProgramNextToIt) {
  const Directory directory;
  std::filesystem::copy_file(LAMINA_PROGRAM, directory / "lamina");
  test::write_text(directory / "lamina-preview", "#!/bin/sh\nprintf '%s|' \"$@\"\nexit 7\n");
  std::filesystem::permissions(directory / "lamina-preview", std::filesystem::perms::owner_all);
  const std::string command =
      "'" + (directory / "lamina") + "' preview out 'a b' --layers 1:2 > '" + (directory / "stated") + "'; exit $?";
  EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 7);
  EXPECT_EQ(test::read_text(directory / "stated"), "out|a b|--layers|1:2|");
}

}  // namespace
}  // namespace lamina::pipeline
