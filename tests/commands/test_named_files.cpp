// Files in a job file are relative to its folder: parts, profiles, presets, output, regardless of the working folder.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/commands/job_folder.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

/// jobs/job.toml names a part, a profile and a preset next to it; files of their names elsewhere are others.
class NamedFiles : public JobFolder {
 protected:
  NamedFiles() {
    for (const char* folder : {"jobs/shop", "away"}) fs::create_directories(folder_ / folder);
    write_box(folder_ / "jobs/part.stl", {0, 0, 0}, {6, 4, 3});
    write_text(folder_ / "jobs/mine.toml", "inherits = \"nuferbj\"\n[machine]\nname = \"mine\"\n");
    write_text(folder_ / "jobs/shop/dear.toml", "[cost]\nhour_price = 80\n");
    write_text(folder_ / "jobs/job.toml", kMachine + kRest);
  }
  Outcome in(const std::string& folder, const std::string& line) const {
    return run_lamina(words_of(line), folder_.path() / folder);
  }
  void done_in(const std::string& folder, const std::string& line) const {
    const Outcome outcome = in(folder, line);
    ASSERT_EQ(outcome.code, 0) << folder << ": " << line << "\n" << outcome.err;
  }
  /// A line of the saved or recorded text.
  std::string line_of(const std::string& file, const std::string& begin) const {
    const std::string text = read_text(folder_ / file);
    const std::size_t at = text.find(begin);
    return at == std::string::npos ? text : text.substr(at, text.find_first_of("\n]", at) - at);
  }

  const std::string kMachine = "[machine]\nprofile = \"mine.toml\"\npresets = [\"example-sand\", \"shop/dear.toml\"]\n";
  const std::string kRest = "[layers]\nthickness_mm = 1\n[[part]]\npath = \"part.stl\"\n";
};

TEST_F(NamedFiles, AreFoundFromAnyFolderAndTheJobIsTheSame) {
  write_text(folder_ / "mine.toml", "inherits = \"jet1000\"\n[machine]\nname = \"another\"\n");
  write_text(folder_ / "away/mine.toml", "no profile\n");
  done_in("jobs", "jet --job job.toml --quiet -o ../one");
  done_in("", "jet --job jobs/job.toml --quiet -o two");
  done_in("away", "jet --job ../jobs/job.toml --quiet -o ../three");
  done_in("away", "jet --job ../away/../jobs/./job.toml --quiet -o ../four");
  for (const char* other : {"two", "three", "four"}) EXPECT_TRUE(tree(other) == tree("one")) << other;
  EXPECT_NE(read_text(folder_ / "one/program/machine.toml").find("hour_price = 80\n"), std::string::npos);
  EXPECT_NE(
      read_text(folder_ / "one/manifest.json").find(R"(profile = \"mine.toml\"\npresets = [\"example-sand\", \"dear.toml\"])"),
      std::string::npos);
  done("verify one --quiet");
  // On the command line they begin where lamina runs.
  EXPECT_EQ(in("", "jet --job jobs/job.toml --machine mine.toml --dry-run --json --quiet").out.find("\"mine\""),
            std::string::npos);
  done_in("jobs", "jet --job job.toml --machine mine.toml --preset shop/dear.toml --dry-run --quiet");
  EXPECT_EQ(in("", "jet --job jobs/job.toml --set machine.presets=shop/dear.toml --dry-run").code, 2);
}

TEST_F(NamedFiles, LeaveJobsOneThatAreResumedOrMergedElsewhere) {
  done_in("jobs", "jet --job job.toml --quiet -o ../whole");
  done_in("jobs", "jet --job job.toml --quiet -o ../shards --shard 1/2");
  done_in("away", "jet --job ../jobs/job.toml --quiet -o ../shards --shard 2/2");
  done("merge shards -o shards --quiet");
  EXPECT_TRUE(tree("shards") == tree("whole"));
  fs::remove(folder_ / "whole/layers/000001.tif");
  const Outcome resumed = in("", "jet --job jobs/job.toml --quiet --json -o whole --resume");
  EXPECT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_NE(resumed.out.find("\"layers_kept\":2"), std::string::npos) << resumed.out;
  EXPECT_TRUE(tree("shards") == tree("whole"));
  // The file is found again, and says something else.
  write_text(folder_ / "jobs/shop/dear.toml", "[cost]\nhour_price = 81\n");
  EXPECT_EQ(in("", "jet --job jobs/job.toml --quiet -o whole --resume").code, 2);
}

TEST_F(NamedFiles, AreNamedBySavedJobsSuchThatTheseRunAnywhere) {
  done_in("jobs", "jet --job job.toml --quiet -o ../one");
  // Below the saved job by a relative path, elsewhere by a whole one.
  for (const char* saved : {"jobs/saved.toml", "away/saved.toml", "jobs/shop/saved.toml", "saved.toml"}) {
    done_in("", "jet --job jobs/job.toml --quiet --dry-run --save-job " + std::string(saved));
    done_in("away", "jet --job ../" + std::string(saved) + " --quiet -o ../again --overwrite");
    EXPECT_TRUE(tree("again") == tree("one")) << saved;
  }
  EXPECT_EQ(line_of("jobs/saved.toml", "profile = "), "profile = \"mine.toml\"");
  EXPECT_EQ(line_of("saved.toml", "presets = "), "presets = [\"example-sand\", \"jobs/shop/dear.toml\"");
  EXPECT_EQ(line_of("away/saved.toml", "profile = "),
            "profile = \"" + fs::canonical(folder_ / "jobs/mine.toml").string() + "\"");
  // So are those of options, and names stay.
  done_in(
      "jobs",
      "jet part.stl --layer 1 --machine ./mine.toml --preset example-sand,shop/dear.toml --quiet --dry-run --save-job ../away/by.toml");
  done("jet --job away/by.toml --quiet -o again --overwrite");
  EXPECT_TRUE(tree("again") == tree("one"));
  done_in("jobs", "jet part.stl --layer 1 --machine nuferbj --quiet --dry-run --save-job shop/named.toml");
  EXPECT_EQ(line_of("jobs/shop/named.toml", "profile = "), "profile = \"nuferbj\"");
  done("jet --job jobs/shop/named.toml --quiet --dry-run");
}

TEST_F(NamedFiles, WithoutAnEndingStayPaths) {
  fs::copy_file(folder_ / "jobs/mine.toml", folder_ / "jobs/nuferbj");
  write_text(folder_ / "jobs/plain.toml", "[machine]\nprofile = \"./nuferbj\"\n" + kRest);
  for (const auto& [folder, job] : {std::pair{"jobs", "plain.toml"}, {"jobs", "./plain.toml"}, {"", "jobs/plain.toml"}}) {
    done_in(folder, std::string("jet --quiet --dry-run --job ") + job + " --save-job " + folder_ / "jobs/saved.toml");
    EXPECT_EQ(line_of("jobs/saved.toml", "profile = "), "profile = \"./nuferbj\"");
    const Outcome reported = in(folder, std::string("jet --quiet --json --dry-run --job ") + job);
    EXPECT_NE(reported.out.find("\"mine\""), std::string::npos) << reported.out;
  }
}

TEST_F(NamedFiles, OfPrintersOfFilamentDoSoToo) {
  write_text(folder_ / "jobs/slow.toml", "inherits = \"marlin\"\n[machine]\nname = \"slow\"\n");
  write_text(folder_ / "jobs/tube.toml", "[machine]\nprofile = \"slow.toml\"\n" + kRest);
  done("extrude --job jobs/tube.toml --layer 0.2 --quiet -o one.gcode");
  done_in("away", "extrude --job ../jobs/tube.toml --layer 0.2 --quiet -o ../two.gcode --save-job saved.toml");
  done("extrude --job away/saved.toml --quiet -o three.gcode");
  EXPECT_EQ(read_text(folder_ / "two.gcode"), read_text(folder_ / "one.gcode"));
  EXPECT_EQ(read_text(folder_ / "three.gcode"), read_text(folder_ / "one.gcode"));
}

TEST_F(NamedFiles, ThatAreNotThereAreReportedWithWhereTheyWereSearched) {
  const std::string corrected = "no such profile; correct it (relative paths start at the job file";
  fs::rename(folder_ / "jobs/mine.toml", folder_ / "mine.toml");
  expect_refused(
      "jet --job jobs/job.toml --dry-run", 2,
      "jobs/job.toml:2:11: machine.profile: jobs/mine.toml: " + corrected + ", not where lamina runs, where mine.toml is)",
      folder_);
  fs::remove(folder_ / "mine.toml");
  expect_refused("jet --job jobs/job.toml --dry-run", 2, "machine.profile: jobs/mine.toml: " + corrected + ")", folder_);
  // One that another takes the place of is not missed, nor by a command without a machine.
  done("jet --job jobs/job.toml --machine nuferbj --dry-run --quiet");
  done("slice --job jobs/job.toml --dry-run --quiet");
  fs::remove(folder_ / "jobs/shop/dear.toml");
  expect_refused("jet --job jobs/job.toml --machine nuferbj --dry-run", 2,
                 "jobs/job.toml:3:28: machine.presets: jobs/shop/dear.toml: " + corrected + ")", folder_);
  write_text(folder_ / "jobs/tube.toml", "[machine]\nprofile = \"slow.toml\"\n" + kRest);
  expect_refused("extrude --job jobs/tube.toml -o x.gcode", 2,
                 "jobs/tube.toml:2:11: machine.profile: jobs/slow.toml: " + corrected, folder_);
}

TEST_F(NamedFiles, OfAFolderWithACommaAreNoPresets) {
  fs::create_directories(folder_ / "a,b");
  write_text(folder_ / "a,b/dear.toml", "[cost]\nhour_price = 80\n");
  write_text(folder_ / "a,b/job.toml", "[machine]\nprofile = \"nuferbj\"\npresets = [\"dear.toml\"]\n" + kRest);
  fs::copy_file(folder_ / "jobs/part.stl", folder_ / "a,b/part.stl");
  done_in("a,b", "jet --job job.toml --dry-run --quiet --save-job saved.toml");
  expect_refused("jet --job a,b/job.toml --dry-run", 2,
                 "a,b/job.toml:3:12: machine.presets: a,b/dear.toml: a comma divides presets; rename the file or its folder",
                 folder_);
  EXPECT_EQ(in("a,b", "jet --job job.toml --dry-run --save-job ../away/saved.toml").code, 2);
  EXPECT_FALSE(fs::exists(folder_ / "away/saved.toml"));
}

}  // namespace
}  // namespace lamina::test
