// tests/commands/test_outputs.cpp: no command replaces what it reads, a device, or a file that lamina did not write.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <algorithm>

#include "pipeline/cli/command.h"
#include "pipeline/cli/outputs.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

class Outputs : public ::testing::Test {
 protected:
  Outputs() {
    write_one_of_each_kind(directory_);
    for (const char* name : {"mine", "mine.svg", "mine.png", "mine.html", "mine.toml", "mine.stl"})
      write_text(directory_ / name, "precious, and of somebody else\n");
    fs::create_symlink("part.stl", directory_ / "link.stl");
    fs::create_hard_link(directory_ / "part.stl", directory_ / "hard.stl");
  }

  Outcome run(const std::string& line) { return run_lamina(words_of(line), directory_.path()); }
  void done(const std::string& line) {
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  }
  void refused(const std::string& line, int code, const std::string& words) { expect_refused(line, code, words, directory_); }

  Directory directory_;
};

TEST_F(Outputs, WhatACallReadsIsNeverReplaced) {
  done("jet part.stl --layer 1 --dpi 60 --format png -o out --quiet");
  fs::copy(directory_ / "part.stl", directory_ / "out/layers/part.stl");
  done("slice --job job.toml -o cut --quiet");
  done("extrude part.stl --machine anet-a8 --layer 0.3 -o part.gcode --quiet");
  fs::create_directory(directory_ / "own");
  fs::copy(fs::path(LAMINA_TEST_DIR) / "corpus/arrow_scaled_mirrored.3mf", directory_ / "own/arrow.3mf");
  // A toolpath file of SML has its layer table next to it, under its own name except the extension.
  fs::create_directory(directory_ / "sml");
  fs::copy(directory_ / "part.stl", directory_ / "sml/part.rp3");
  fs::copy(fs::path(LAMINA_TEST_DIR) / "../pipeline/machine/shipped/extruders/fdm-2000.toml", directory_ / "sml/printer.rp3");
  write_text(directory_ / "sml/job.rp3", "[layers]\nthickness_mm = 0.254\n[[part]]\npath = \"../part.stl\"\n");
  write_text(directory_ / "sml/named.toml", "[machine]\nprofile = \"printer.rp3\"\n[[part]]\npath = \"../part.stl\"\n");
  fs::create_directory(directory_ / "farm");
  fs::copy(directory_ / "list.txt", directory_ / "farm/summary.tsv");

  const struct {
    const char *line, *survives;
  } rows[] = {
      {"jet part.stl -o part.stl", "part.stl"},
      {"jet --job job.toml -o job.toml", "job.toml"},
      {"jet part.stl --dry-run --save-job part.stl", "part.stl"},
      {"jet part.stl --dry-run --save-job link.stl --overwrite", "link.stl"},
      {"jet part.stl --machine powder.toml --dry-run --save-job powder.toml --overwrite", "powder.toml"},
      {"jet part.stl --set machine.profile=powder.toml --dry-run --save-job powder.toml", "powder.toml"},
      {"jet --job job.toml --dry-run --save-job job.toml --overwrite", "job.toml"},
      {"jet --job job.toml --dry-run --save-job part.stl --overwrite", "part.stl"},
      {"jet out/layers/part.stl -o out --overwrite", "out/layers/part.stl"},
      {"slice part.stl -o part.stl", "part.stl"},
      {"slice part.stl --dry-run --save-job hard.stl --overwrite", "hard.stl"},
      {"slice --job cut/job.toml -o cut --overwrite", "cut/job.toml"},
      {"slice own/arrow.3mf --layer 1 --format 3mf -o own --overwrite", "own/arrow.3mf"},
      {"extrude part.stl --layer 1 -o part.stl", "part.stl"},
      {"extrude part.stl --layer 1 -o link.stl", "part.stl"},
      {"extrude part.stl --layer 1 -o hard.stl", "part.stl"},
      {"extrude ./part.stl --layer 1 -o cut/../part.stl", "part.stl"},
      {"extrude part.stl --machine ./printer.toml -o printer.toml", "printer.toml"},
      {"extrude --job job.toml -o job.toml", "job.toml"},
      {"extrude --job job.toml -o part.stl", "part.stl"},
      {"extrude part.stl --set run.output=part.stl", "part.stl"},
      {"extrude part.stl -o new.gcode --save-job part.stl", "part.stl"},
      {"extrude sml/part.rp3 --machine fdm-2000 -o sml/part.sml --overwrite", "sml/part.rp3"},
      {"extrude part.stl --machine sml/printer.rp3 -o sml/printer.sml --overwrite", "sml/printer.rp3"},
      {"extrude --job sml/job.rp3 --machine fdm-2000 -o sml/job.sml --overwrite", "sml/job.rp3"},
      {"extrude --job sml/named.toml -o sml/printer.sml --overwrite", "sml/printer.rp3"},
      {"extrude --job sml/named.toml --set run.output=sml/printer.sml --overwrite", "sml/printer.rp3"},
      {"heights part.stl -o cut/job.toml --plot cut/../cut/job.toml --overwrite", "cut/job.toml"},
      {"extrude part.stl -o cut/part.svg --save-job cut/part.svg --overwrite", "cut/part.svg"},
      {"heights part.stl -o part.stl", "part.stl"},
      {"heights part.stl -o part.stl --overwrite", "part.stl"},
      {"heights --job job.toml -o job.toml", "job.toml"},
      {"heights --job job.toml -o part.stl --overwrite", "part.stl"},
      {"heights part.stl --measure tops.txt -o tops.txt", "tops.txt"},
      {"heights part.stl --save-job part.stl", "part.stl"},
      {"calibrate --machine anet-a8 --measured widths.csv -o widths.csv", "widths.csv"},
      {"calibrate --machine printer.toml --measured widths.csv -o printer.toml --overwrite", "printer.toml"},
      {"design --pore 0.12x0.9 --machine printer.toml --voxel 40 -o printer.toml --overwrite", "printer.toml"},
      {"permeability drops.csv --convention dinisio2022 --plot drops.csv", "drops.csv"},
      {"permeability drops.csv --convention dinisio2022 --plot drops.csv --overwrite", "drops.csv"},
      {"permeability job.toml --machine anet-a8 --solid part.stl --overwrite", "part.stl"},
      {"permeability job.toml --machine anet-a8 --void job.toml --overwrite", "job.toml"},
      {"machines --check powder.toml --target powder.toml", "powder.toml"},
      {"machines powder.toml --target powder.toml --overwrite", "powder.toml"},
      {"preview part.gcode -o part.gcode", "part.gcode"},
      {"preview cut -o cut/part.svg --overwrite", "cut/part.svg"},
      {"preview out -o out/layers/000000.png --overwrite", "out/layers/000000.png"},
      {"report out --parts part.stl -o part.stl", "part.stl"},
      {"batch farm/summary.tsv -o farm --overwrite", "farm/summary.tsv"},
  };
  for (const auto& row : rows) {
    const std::string before = read_text(directory_ / row.survives);
    const Outcome outcome = run(row.line);
    EXPECT_EQ(outcome.code, 2) << row.line << "\n" << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << row.line << "\n" << outcome.err;
    EXPECT_NE(outcome.err.find(fs::path(row.survives).stem().string()), std::string::npos) << row.line << "\n" << outcome.err;
    EXPECT_TRUE(read_text(directory_ / row.survives) == before) << row.line;
    EXPECT_FALSE(fs::exists(directory_ / (std::string(row.survives) + ".part"))) << row.line;
  }
}

TEST_F(Outputs, WhatLaminaDidNotWriteIsReplacedOnlyWithOverwrite) {
  done("jet part.stl --layer 1 --dpi 60 -o out --quiet");
  done("extrude part.stl --machine anet-a8 --layer 0.3 -o part.gcode --quiet");
  const std::string words = "is there already, and is no such file of lamina; name another one, or replace it with --overwrite";
  const struct {
    const char *call, *output;
  } rows[] = {
      {"heights part.stl --layer 1 --quiet -o ", "mine"},
      {"heights part.stl --layer 1 --quiet -o ", "mine.stl"},
      {"heights part.stl --layer 1 --quiet -o new --plot ", "mine.svg"},
      {"heights part.stl --layer 1 --quiet -o new --plot ", "mine.png"},
      {"jet part.stl --layer 1 --dry-run --quiet --save-job ", "mine.toml"},
      {"permeability drops.csv --convention dinisio2022 --plot ", "mine.svg"},
      {"preview part.gcode --quiet -o ", "mine.png"},
      {"preview part.gcode --quiet -o ", "mine.svg"},
      {"report out --quiet -o ", "mine.html"},
      {"machines --target ", "mine.stl"},
      {"machines --target ", "hard.stl"},
  };
  for (const auto& row : rows) {
    const std::string before = read_text(directory_ / row.output);
    refused(std::string(row.call) + row.output, 2, row.output + (": " + words));
    done(std::string(row.call) + row.output + " --overwrite");
    EXPECT_TRUE(read_text(directory_ / row.output) != before) << row.call;
    write_text(directory_ / row.output, before);
    fs::remove(directory_ / "new");
  }
  refused("calibrate --machine anet-a8 --measured widths.csv -o mine.toml", 2, words);
  fs::create_directory(directory_ / "pages");
  write_text(directory_ / "pages/batch.md", "precious\n");
  refused("manual --markdown -o pages", 2, words);
}

TEST_F(Outputs, WhatLaminaWroteIsWrittenAgain) {
  done("jet part.stl --layer 1 --dpi 60 -o out --quiet");
  done("extrude part.stl --machine anet-a8 --layer 0.3 -o part.gcode --quiet");
  for (const std::string line :
       {"heights part.stl --layer 1 --quiet -o table", "heights part.stl --layer 1 --format csv --quiet -o csv",
        "heights part.stl --layer 1 --format json --quiet -o json", "heights part.stl --layer 1 --format rp3 --quiet -o rp3",
        "heights part.stl --thickness 0.5,1 --compare --quiet -o compared",
        "heights part.stl --layer 1 --quiet -o table --plot plot.svg",
        "heights part.stl --layer 1 --quiet -o table --plot plot.png",
        "permeability drops.csv --convention dinisio2022 --plot fit.svg", "preview part.gcode --quiet -o layer.svg",
        "preview part.gcode --quiet -o layer.png", "preview out --quiet --width 200 -o sheet.png",
        "report out --quiet -o page.html", "machines --target target.stl",
        "jet part.stl --layer 1 --dry-run --quiet --save-job saved.toml", "manual -o man", "manual --markdown -o pages"}) {
    done(line);
    done(line);
  }
  write_text(directory_ / "empty", "");
  done("heights part.stl --layer 1 --quiet -o empty");
  EXPECT_NE(read_text(directory_ / "empty"), "");
}

TEST_F(Outputs, DevicesAndPipesStayWhatTheyAre) {
  std::vector<std::string> positions = {"pipe", "link"};
  ASSERT_EQ(::mkfifo((directory_ / "pipe").c_str(), 0600), 0);
  fs::create_symlink("pipe", directory_ / "link");
  const bool devices = ::mknod((directory_ / "null").c_str(), S_IFCHR | 0600, makedev(1, 3)) == 0;
  if (devices) positions.push_back("null");
  for (const std::string& position : positions) {
    for (const std::string ending : {".svg", ".png", ".html"}) {
      fs::create_symlink(position, directory_ / (position + ending));
    }
  }
  for (const std::string& position : positions) {
    for (const std::string& line :
         {"heights part.stl --layer 1 --plot " + position + ".svg", "heights part.stl --layer 1 --plot " + position + ".png",
          "permeability drops.csv --convention dinisio2022 --plot " + position,
          "jet part.stl --layer 1 --dry-run --overwrite --save-job " + position, "machines --target " + position,
          "calibrate --machine anet-a8 --measured widths.csv -o " + position,
          "report out --overwrite -o " + position + ".html"}) {
      refused(line, 4, "is a device or a pipe, not a file; name another one");
    }
  }
  refused("machines --target -", 4, "-: is standard output, not a file; name another one");
  struct stat status {};
  EXPECT_TRUE(::lstat((directory_ / "pipe").c_str(), &status) == 0 && S_ISFIFO(status.st_mode));
  if (!devices) GTEST_SKIP() << "mknod is not permitted here: pipes were tried, devices were not";
  done("heights part.stl --layer 1 --quiet -o null");
  EXPECT_TRUE(::lstat((directory_ / "null").c_str(), &status) == 0 && S_ISCHR(status.st_mode));
}

TEST_F(Outputs, ATableOfHeightsGoesToStandardOutputByName) {
  const std::string table = run("heights part.stl --layer 1 --quiet --format csv").out;
  EXPECT_NE(table, "");
  EXPECT_EQ(run("heights part.stl --layer 1 --quiet --format csv -o -").out, table);
  EXPECT_FALSE(fs::exists(directory_ / "-"));
}

TEST(OutputOptions, EveryOptionThatNamesAFileIsKnownAsReadOrWritten) {
  for (const pipeline::Command* command : pipeline::commands()) {
    for (const pipeline::OptionSpec& option : pipeline::spec_of(*command).options) {
      if (command->name == "jet" && option.flag == "--material") continue;  // names of powders; of extrude a file
      if (option.value.empty()) continue;                                   // a switch, as --quote of nest
      const bool file =
          std::ranges::any_of(std::array{"FILE", "DIR", "HTML", "PNG", "STL", "OUT", "CSV", "PHOTO"},
                              [&](std::string_view word) { return option.value.find(word) != std::string::npos; });
      EXPECT_EQ(file, pipeline::is_input_option(option.flag) || pipeline::is_output_option(option.flag))
          << command->name << " " << option.flag << " " << option.value;
    }
  }
}

}  // namespace
}  // namespace lamina::test
