// Profiles that inherit, presets, and the user's folder.
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/job/profiles/library.h"
#include "pipeline/job/profiles/printer.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"
#include "stages/support/text/toml.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

constexpr std::string_view kDialects[] = {"nuferbj"};

class ProfileLibrary : public ::testing::Test {
 protected:
  ProfileLibrary() { test::write_text(directory_ / "own.toml", "inherits = \"base\"\n[cost]\nhour_price = 40\n"); }
  Library library() {
    return {{{"base", "[machine]\nname = \"base\"\n[head]\ndrop_pl = 12\n[cost]\nhour_price = 10\n"},
             {"powder", "[powder]\npacking = 0.5\n[head]\ndrop_pl = 30\n"}},
            directory_.path().string()};
  }
  std::string write(const std::string& name, const std::string& text) {
    test::write_text(directory_ / name, text);
    return directory_ / name;
  }
  std::string refused(const std::string& name) {
    ProfileFiles files;
    const Status status = library().add(name, files);
    EXPECT_FALSE(status.ok());
    return status ? "" : status.error().message;
  }
  Machine machine(const std::vector<std::string>& names) {
    for (const std::string& name : names) {
      const Status status = library().add(name, files_);
      EXPECT_TRUE(status.ok()) << (status ? "" : status.error().message);
    }
    const auto machine = read_machine(files_, kDialects);
    EXPECT_TRUE(machine.ok()) << (machine ? "" : machine.error().message);
    return machine ? *machine : Machine();
  }

  test::Directory directory_;
  ProfileFiles files_;
};

TEST_F(ProfileLibrary, TheLastFileThatSaysAKeyCounts) {
  const Machine one = machine({"own", "powder"});
  EXPECT_EQ(one.name, "base");
  EXPECT_EQ(one.cost.hour_price, 40);
  EXPECT_EQ(one.head.drop_pl, 30);
  EXPECT_EQ(one.powder.packing, 0.5);
  EXPECT_EQ(files_.size(), 3u);
  const std::string text = sourced_text(machine_text(one), files_);
  EXPECT_NE(text.find("drop_pl = 30  # powder.toml:4\n"), std::string::npos) << text;
  EXPECT_NE(text.find("hour_price = 40  # " + (directory_ / "own.toml") + ":3\n"), std::string::npos) << text;
  EXPECT_NE(text.find("dose = 1.2  # default\n"), std::string::npos) << text;
  const auto keys = read_toml(text, "again");
  ASSERT_TRUE(keys.ok());
  const auto again = read_machine(ProfileFiles{{*keys, "again", {}}}, kDialects);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(machine_text(*again), machine_text(one));
}

TEST_F(ProfileLibrary, AListHasItsOrderAndAFileCountsOnce) {
  write("a.toml", "inherits = \"base\"\n[cost]\nhour_price = 20\n");
  const Machine two = machine({write("b.toml", "inherits = [\"./a.toml\", \"powder\", \"base\"]\n")});
  EXPECT_EQ(two.cost.hour_price, 20);  // base is not read again after a
  EXPECT_EQ(two.head.drop_pl, 30);
  EXPECT_EQ(files_.size(), 4u);
  files_.clear();
  EXPECT_EQ(machine({"base", directory_ / "b.toml"}).cost.hour_price, 20);
}

TEST_F(ProfileLibrary, WhatIsWrongIsReportedWithFileAndKey) {
  const std::string a = write("a.toml", "inherits = \"b.toml\"\n");
  const std::string b = write("b.toml", "\ninherits = \"sub/../a.toml\"\n");
  EXPECT_EQ(refused(a), b + ":2:12: inherits: goes round in a circle: " + a + " > " + b + " > " + a);
  EXPECT_TRUE(refused(write("c.toml", "inherits = \"bass\"\n")).ends_with("one of base, powder, a, b, c, own"));
  EXPECT_NE(refused(directory_ / "c.toml").find("c.toml:1:12: inherits: no profile 'bass'; did you mean 'base'?"),
            std::string::npos);
  EXPECT_NE(refused(write("d.toml", "inherits = [\"base\", [1]]\n")).find("d.toml:1:12: inherits: is the name"),
            std::string::npos);
  EXPECT_NE(refused(write("e.toml", "inherits = \"none.toml\"\n"))
                .find("e.toml:1:12: inherits: " + (directory_ / "none.toml") + ": no such"),
            std::string::npos);
  EXPECT_NE(refused(write("f.toml", "inherits = \n")).find("f.toml:1:"), std::string::npos);
  write("base.toml", "[machine]\nname = \"mine\"\n");
  EXPECT_NE(refused("base").find("has that name as well; rename the file"), std::string::npos);
  std::string before = "powder";
  for (int depth = 0; depth < 20; ++depth) {
    const std::string name = "deep" + std::to_string(depth);
    write(name + ".toml", "inherits = \"" + before + "\"\n");
    before = name;
  }
  EXPECT_TRUE(refused("deep19").ends_with("is more than 16 files deep")) << refused("deep19");
}

TEST_F(ProfileLibrary, AWrongKeyIsReportedWithTheFileThatHasIt) {
  write("bad.toml", "inherits = \"base\"\n[head]\nnozzels = 3\n");
  ASSERT_TRUE(library().add(write("good.toml", "inherits = \"bad\"\n[head]\nnozzles = 3\n"), files_).ok());
  const auto machine = read_machine(files_, kDialects);
  ASSERT_FALSE(machine.ok());
  EXPECT_TRUE(machine.error().message.starts_with((directory_ / "bad.toml") + ":3:")) << machine.error().message;
}

TEST_F(ProfileLibrary, JobsArePlannedWithPresetsAndKeepWhatCameOut) {
  test::write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3});
  write("shop.toml", "inherits = [\"hp45\", \"example-steel\"]\n[cost]\nhour_price = 40\n");
  write("dear.toml", "[cost]\nhour_price = 80\n");
  const auto run = [&](const std::string& line) { return test::run_lamina(test::words_of(line), directory_.path()); };
  ASSERT_EQ(run("jet part.stl --machine shop.toml --preset ./dear.toml,example-sand --layer 1 --quiet -o out").code, 0);
  const std::string kept = test::read_text(directory_ / "out/program/machine.toml");
  EXPECT_NE(kept.find("hour_price = 80\n"), std::string::npos) << kept;
  EXPECT_NE(kept.find("powder_kg_l = 1.59\n"), std::string::npos) << kept;
  EXPECT_EQ(kept.find("inherits"), std::string::npos) << kept;
  EXPECT_NE(test::read_text(directory_ / "out/manifest.json").find("presets = [\\\"dear.toml\\\", \\\"example-sand\\\"]"),
            std::string::npos);
  EXPECT_EQ(run("verify out --quiet").code, 0);
  // Another preset is another job.
  EXPECT_EQ(run("jet part.stl --machine shop.toml --preset example-sand --layer 1 --quiet -o out --resume").code, 2);
  const test::Outcome unknown = run("jet part.stl --machine shop.toml --preset example-sant --layer 1 -o no");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_NE(unknown.err.find("--preset: no profile 'example-sant'; did you mean 'example-sand'?"), std::string::npos)
      << unknown.err;
  EXPECT_EQ(run("jet part.stl --preset example-sand --layer 1 -o no").code, 2);
}

}  // namespace
}  // namespace lamina::pipeline
