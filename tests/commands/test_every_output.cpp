// tests/commands/test_every_output.cpp: laws that every option naming an output obeys, in every command.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <set>
#include <sstream>
#include <thread>

#include "pipeline/cli/command.h"
#include "pipeline/cli/outputs.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

/// A row of outputs.tsv.
struct Row {
  std::string call, flag, read, lock;
  bool directory, stream, product;
  std::string command = call.substr(0, call.find(' '));
};

std::vector<Row> read_rows() {
  std::istringstream table(read_text(fs::path(LAMINA_TEST_DIR) / "commands/outputs.tsv"));
  std::vector<Row> rows;
  for (std::string line; std::getline(table, line);) {
    if (line.starts_with("#") || line.starts_with("call\t")) continue;
    std::vector<std::string> cells(1);
    for (const char one : line) one == '\t' ? cells.emplace_back() : cells.back() += one;
    cells.resize(5);
    const auto is = [&](const char* kind) { return cells[4].find(kind) != std::string::npos; };
    rows.push_back({cells[0], cells[1], cells[2], cells[3], is("directory"), is("stream"), is("product")});
  }
  return rows;
}

/// Rows of outputs, and calls that make their inputs.
std::vector<Row> rows_of(bool outputs) {
  std::vector<Row> rows = read_rows();
  std::erase_if(rows, [&](const Row& row) { return row.flag.empty() == outputs; });
  return rows;
}
const std::vector<Row>& output_rows() {
  static const std::vector<Row> rows = rows_of(true);
  return rows;
}

/// Values of options that name no file, in addition to lists of words to choose from.
const std::set<std::string_view> kNoFiles = {"A:B",
                                             "AXES",
                                             "DARCY",
                                             "DEG",
                                             "DEG,...",
                                             "DEGC",
                                             "DPI|XxY",
                                             "ENGINE",
                                             "FACTOR",
                                             "FILLING",
                                             "FOLDER",
                                             "FORMAT",
                                             "FORMULA",
                                             "G/CM3",
                                             "G/ML",
                                             "I/N",
                                             "K",
                                             "KEY=VALUE",
                                             "KEY=VALUE;...",
                                             "KG/M3",
                                             "LOOPS",
                                             "MG",
                                             "KIND",
                                             "MM",
                                             "MM/S",
                                             "MM2",
                                             "MM[,MM...]",
                                             "MODE",
                                             "N",
                                             "N,...",
                                             "N,N,...",
                                             "NAME",
                                             "NAME|NAME,...",
                                             "N|auto",
                                             "PA",
                                             "PA.S",
                                             "PATTERN",
                                             "PART",
                                             "PERCENT",
                                             "PERCENT|FORMULA",
                                             "PIXELS",
                                             "RULE",
                                             "SECONDS",
                                             "SET",
                                             "SET|RANGE",
                                             "SHARE",
                                             "SIZE",
                                             "S[,S]",
                                             "S|X,Y,Z",
                                             "UM",
                                             "UM|XxY",
                                             "UNIT",
                                             "WHEN",
                                             "WIDTHxDEPTH",
                                             "WIDTHxLENGTH",
                                             "WORD",
                                             "WORDS",
                                             "X,Y",
                                             "X,Y,Z"};

std::string all_messages(const Outcome& outcome, const Row& row) { return row.call + "\n" + outcome.err; }

class EveryOutput : public ::testing::Test {
 protected:
  EveryOutput() {
    const fs::path tests = LAMINA_TEST_DIR;
    write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3});
    fs::copy(tests / "reference/dinisio2022/table_18.tsv", directory_ / "drops.csv");
    fs::copy(tests / ".." / "pipeline/machine/shipped/extruders/anet-a8.toml", directory_ / "printer.toml");
    write_text(directory_ / "widths.csv", kWidths);
    write_text(directory_ / "list.txt", "info part.stl\n");
    fs::create_directory(directory_ / "inbox");
    write_text(directory_ / "filament.ini", "temperature = 200\n");
    for (const Row& row : rows_of(false)) {
      const std::string& line = row.call;
      const Outcome outcome = run(line);
      EXPECT_EQ(outcome.code, 0) << line << outcome.err;
    }
  }

  Outcome run(const std::string& line) { return run_lamina(words_of(line), directory_.path()); }
  static std::string line_of(const Row& row, const std::string& name) {
    std::string line = row.call;
    return line.replace(line.find('@'), 1, name);
  }
  /// The name of the output, with the ending that the row's call gives it.
  static std::string target_of(const Row& row, const std::string& name) {
    const std::string line = line_of(row, name);
    const std::size_t begin = row.call.find('@');
    return line.substr(begin, line.find(' ', begin) - begin);
  }
  static std::string forced(const Row& row, const std::string& name) {
    const pipeline::CommandSpec spec = pipeline::spec_of(*pipeline::find_command(row.command));
    return line_of(row, name) + (spec.find("--overwrite") != nullptr ? " --overwrite" : "");
  }
  /// Names below the directory that only an unfinished run leaves.
  std::vector<std::string> unfinished(const std::string& below = ".") {
    std::vector<std::string> names = files_below(directory_ / below);
    std::erase_if(names, [](const std::string& name) { return !name.ends_with(".part"); });
    return names;
  }
  /// Removes what the rows write.
  void clean() {
    std::vector<fs::path> made;
    for (const fs::directory_entry& entry : fs::directory_iterator(directory_.path())) {
      if (entry.path().filename().string().starts_with('x')) made.push_back(entry.path());
    }
    for (const fs::path& path : made) fs::remove_all(path);
  }
  void refused(const Row& row, const Outcome& outcome) {
    EXPECT_TRUE(outcome.code == 2 || outcome.code == 4) << outcome.code << " " << all_messages(outcome, row);
    EXPECT_EQ(outcome.error_lines(), 1u) << all_messages(outcome, row);
  }

  static constexpr const char* kWidths = "test,percent,thin_mm\nextrusion,90,0.3\nextrusion,80,0.25\nextrusion,70,0.2\n";
  static constexpr const char* kMine = "precious, and of somebody else\n";
  Directory directory_;
};

TEST(EveryOutputOption, HasARowHere) {
  for (const pipeline::Command* command : pipeline::commands()) {
    for (const pipeline::OptionSpec& option : pipeline::spec_of(*command).options) {
      if (!pipeline::is_output_option(option.flag) || option.value.empty()) continue;
      EXPECT_TRUE(std::ranges::any_of(output_rows(),
                                      [&](const Row& row) { return row.command == command->name && row.flag == option.flag; }))
          << command->name << " " << option.flag;
    }
  }
}

TEST(EveryOutputOption, ANewKindOfValueIsSaidToBeAFileOrNot) {
  for (const pipeline::Command* command : pipeline::commands()) {
    for (const pipeline::OptionSpec& option : pipeline::spec_of(*command).options) {
      const bool file = pipeline::is_input_option(option.flag) || pipeline::is_output_option(option.flag);
      const bool choice = std::ranges::none_of(option.value, [](char one) { return one >= 'A' && one <= 'Z'; });
      EXPECT_TRUE(file || choice || kNoFiles.contains(option.value))
          << command->name << " " << option.flag << " " << option.value;
    }
  }
}

TEST_F(EveryOutput, AppearsWholeAndAloneAndIsWrittenAgainOnlyByItsOwnKind) {
  for (const Row& row : output_rows()) {
    const Outcome first = run(line_of(row, "x"));
    EXPECT_EQ(first.code, 0) << all_messages(first, row);
    EXPECT_TRUE(fs::exists(directory_ / target_of(row, "x"))) << row.call;
    EXPECT_EQ(unfinished(), std::vector<std::string>()) << row.call;
    const std::string before = tree_text(directory_.path());
    const Outcome again = run(line_of(row, "x"));
    EXPECT_EQ(again.code, row.product ? 2 : 0) << all_messages(again, row);
    if (row.product) {
      EXPECT_TRUE(tree_text(directory_.path()) == before) << row.call;
    }
    clean();
  }
}

TEST_F(EveryOutput, SomebodysFileIsNotReplacedUnderAnyNameOrLink) {
  fs::create_directory(directory_ / "far");
  for (const Row& row : output_rows()) {
    const std::string target = target_of(row, "x");
    for (const bool link : {false, true}) {
      const std::string file = link ? "far/mine" : target;
      write_text(directory_ / file, kMine);
      if (link) fs::create_symlink("far/mine", directory_ / target);
      const Outcome outcome = run(line_of(row, "x"));
      refused(row, outcome);
      EXPECT_EQ(read_text(directory_ / file), kMine) << all_messages(outcome, row);
      EXPECT_EQ(fs::is_symlink(directory_ / target), link) << row.call;
      EXPECT_EQ(unfinished(), std::vector<std::string>()) << row.call;
      clean();
    }
  }
}

TEST_F(EveryOutput, LinksThatLeadNowhereOrRoundStayLinks) {
  for (const Row& row : output_rows()) {
    const std::string target = target_of(row, "x");
    for (const std::string& to : {std::string("far"), target}) {
      fs::create_symlink(to, directory_ / target);
      const Outcome outcome = run(line_of(row, "x"));
      EXPECT_TRUE(outcome.code == 0 || outcome.error_lines() == 1) << all_messages(outcome, row);
      if (to == target) refused(row, outcome);
      EXPECT_TRUE(fs::is_symlink(directory_ / target)) << all_messages(outcome, row);
      EXPECT_EQ(outcome.code == 0 && to == "far", fs::exists(directory_ / "far")) << all_messages(outcome, row);
      fs::remove_all(directory_ / "far");
      clean();
    }
  }
}

TEST_F(EveryOutput, NeitherAPipeNorADirectoryThereInsteadIsReplaced) {
  for (const Row& row : output_rows()) {
    const std::string target = target_of(row, "x");
    if (!row.directory) {
      fs::create_directory(directory_ / target);
      refused(row, run(forced(row, "x")));
      EXPECT_TRUE(fs::is_directory(directory_ / target)) << row.call;
      clean();
    }
    if (row.stream) {
      const Outcome full = run(line_of(row, "/dev/full"));
      EXPECT_EQ(full.code, 4) << all_messages(full, row);
      continue;
    }
    ASSERT_EQ(::mkfifo((directory_ / target).c_str(), 0600), 0);
    refused(row, run(forced(row, "x")));
    EXPECT_TRUE(fs::is_fifo(directory_ / target)) << row.call;
    clean();
  }
}

TEST_F(EveryOutput, WhatIsReadSurvivesOverwrite) {
  for (const Row& row : output_rows()) {
    if (row.read.empty()) continue;
    const std::string target = target_of(row, "x"), before = read_text(directory_ / row.read);
    fs::create_hard_link(directory_ / row.read, directory_ / target);
    refused(row, run(forced(row, "x")));
    EXPECT_EQ(read_text(directory_ / row.read), before) << row.call;
    struct stat a {
    }, b{};
    ::stat((directory_ / target).c_str(), &a);
    ::stat((directory_ / row.read).c_str(), &b);
    EXPECT_EQ(a.st_ino, b.st_ino) << row.call;
    clean();
  }
}

TEST_F(EveryOutput, SomebodysPartAndWhatItLeadsToStay) {
  write_text(directory_ / "victim", kMine);
  for (const Row& row : output_rows()) {
    const std::string target = target_of(row, "x"), part = directory_ / (target + row.lock + ".part");
    for (const bool link : {false, true}) {
      if (row.directory) fs::create_directory(directory_ / target);
      if (link) {
        fs::create_symlink(directory_ / "victim", part);
      } else {
        write_text(part, kMine);
      }
      const Outcome outcome = run(line_of(row, "x"));
      EXPECT_TRUE(outcome.code == 0 || outcome.error_lines() == 1) << all_messages(outcome, row);
      EXPECT_EQ(read_text(part), kMine) << all_messages(outcome, row);
      EXPECT_EQ(fs::is_symlink(part), link) << row.call;
      EXPECT_EQ(read_text(directory_ / "victim"), kMine) << row.call;
      clean();
    }
  }
}

TEST_F(EveryOutput, WhileAnotherRunWritesTheCallIsRefused) {
  for (const Row& row : output_rows()) {
    const std::string target = target_of(row, "x");
    if (row.directory) fs::create_directory(directory_ / target);
    std::optional<Claim> claim;
    std::optional<File> file;
    const std::string locked = directory_ / (target + row.lock);
    if (row.lock == "/manifest.json") {
      auto taken = Claim::take(locked, locked);
      ASSERT_TRUE(taken.ok());
      claim.emplace(std::move(*taken));
    } else if (row.command != "batch" && row.command != "watch") {
      auto opened = File::open(locked);
      ASSERT_TRUE(opened.ok());
      file.emplace(std::move(*opened));
    }
    if (!claim && !file) continue;
    const Outcome outcome = run(line_of(row, "x"));
    EXPECT_EQ(outcome.code, 4) << all_messages(outcome, row);
    EXPECT_NE(outcome.err.find("another run is writing here right now"), std::string::npos) << all_messages(outcome, row);
    claim.reset();
    file.reset();
    const Outcome after = run(line_of(row, "x"));
    EXPECT_EQ(after.code, 0) << all_messages(after, row);
    EXPECT_EQ(unfinished(), std::vector<std::string>()) << row.call;
    clean();
  }
}

TEST_F(EveryOutput, OfTwoThatBeginAtOnceWhatStaysIsWhole) {
  for (const Row& row : output_rows()) {
    if (row.flag == "--save-job" && row.command != "jet") continue;  // one function writes them all
    const std::string target = target_of(row, "x");
    std::string alone;
    for (int trial = 0; trial < 2; ++trial) {
      Outcome outcomes[2];
      {
        std::vector<std::jthread> runs;
        for (Outcome& outcome : outcomes) {
          runs.emplace_back([&] { outcome = run(trial == 0 ? line_of(row, "x") : forced(row, "x")); });
          if (trial == 0) break;
        }
      }
      const bool needs_one = trial == 0 || row.command != "calibrate";  // which keeps the table that is filled in
      EXPECT_TRUE(!needs_one || outcomes[0].code == 0 || outcomes[1].code == 0) << all_messages(outcomes[0], row);
      for (const Outcome& outcome : outcomes) {
        if (outcome.code > 0) refused(row, outcome);
      }
      EXPECT_EQ(unfinished(), std::vector<std::string>()) << row.call;
      const bool has_times = row.command == "batch" || row.command == "watch";
      const std::string text = has_times ? "" : row.directory ? tree_text(directory_ / target) : read_text(directory_ / target);
      if (trial == 0) alone = text;
      EXPECT_TRUE(text == alone) << row.call;
    }
    clean();
  }
}

TEST_F(EveryOutput, AFullDiskIsOneLineAndNothingUnderAFinalName) {
  const std::string disk = directory_ / "disk";
  fs::create_directory(disk);
  const bool mounted = ::mount("none", disk.c_str(), "tmpfs", 0, "size=64k") == 0;
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  for (const Row& row : output_rows()) {
    if (row.flag == "--save-job" && row.command != "jet") continue;
    const std::string target = target_of(row, "disk/x");
    if (mounted) {
      std::string filler(4096, 'x');
      const int file = ::open((disk + "/filler").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
      while (::write(file, filler.data(), filler.size()) > 0) {
      }
      ::close(file);
    } else {
      const rlimit none{0, before.rlim_max};  // also of the message, which is not checked then
      ::setrlimit(RLIMIT_FSIZE, &none);
    }
    const Outcome outcome = run(line_of(row, "disk/x"));
    ::setrlimit(RLIMIT_FSIZE, &before);
    EXPECT_EQ(outcome.code, 4) << all_messages(outcome, row);
    EXPECT_TRUE(!mounted || outcome.error_lines() == 1) << all_messages(outcome, row);
    EXPECT_TRUE(row.directory || !fs::exists(directory_ / target)) << row.call;
    for (const std::string& name : files_below(disk)) {
      EXPECT_TRUE(name == "filler" || name.ends_with(".part") || name.ends_with("batch.jsonl") || name.ends_with("watch.jsonl"))
          << name << " " << row.call;
    }
    if (mounted) {
      fs::remove(disk + "/filler");
      for (const fs::directory_entry& entry : fs::directory_iterator(disk)) fs::remove_all(entry.path());
    } else {
      fs::remove_all(disk);
      fs::create_directory(disk);
    }
  }
  if (mounted) ::umount(disk.c_str());
}

}  // namespace
}  // namespace lamina::test
