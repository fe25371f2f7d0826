// What another run does to a directory while this one loads its parts is seen before anything is written.
#include <gtest/gtest.h>

#include <filesystem>

#include "pipeline/output/directory.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

struct LoadingMeanwhile : testing::Test {
  test::Directory folder;
  Job job;
  void SetUp() override {
    job.output = folder / "out";
    ASSERT_TRUE(check_output(job).ok());
    std::filesystem::create_directories(job.output + "/layers");
  }
  std::string refusal() {
    MadeFolders made;
    const auto claim = prepare_output(job, made);
    return claim ? "" : claim.error().message;
  }
};

TEST_F(LoadingMeanwhile, AShardThatIsWritingKeepsItsDirectoryEvenFromOverwrite) {
  const auto shard = File::open(job.output + "/manifest-1-of-2.json", {.keep_part = true});
  ASSERT_TRUE(shard.ok());
  EXPECT_NE(refusal(), "");
  job.overwrite = true;
  EXPECT_NE(refusal(), "");
  EXPECT_TRUE(std::filesystem::exists(job.output + "/manifest-1-of-2.json.part"));
}

TEST_F(LoadingMeanwhile, AFinishedJobIsNotReplaced) {
  test::write_text(job.output + "/manifest.json", "{}");
  EXPECT_NE(refusal().find("a finished job"), std::string::npos);
}

TEST(LayerFiles, AreThoseOfNamesThatLaminaWrites) {
  std::uint32_t index = 0;
  bool partial = false;
  for (const char* name : {"000042.tif", "999999.png", "1234567.tif", "4294967295.tif", "000042-bronze.tif"})
    EXPECT_TRUE(read_layer_file_name(name, index, partial)) << name;
  for (const char* name : {"42.tif", "00042.tif", "0000042.tif", "0000000042.tif", "4294967296.tif", "20240101123000.tif",
                           "000042.tif.bak", "000042", "000042.txt", "000042a.tif", "-000042.tif", " 000042.tif"})
    EXPECT_FALSE(read_layer_file_name(name, index, partial)) << name;
}

TEST(LayerFiles, WhatAKilledJobLeftNextToThemGoesAndNothingElse) {
  const test::Directory directory;
  std::filesystem::create_directories(directory.path() / "program");
  const std::string ours = temporary_name("start.gcode"), theirs = temporary_name("notes.txt");
  for (const std::string& name : {ours, theirs, std::string("start.gcode"), std::string("start.gcode.part")}) {
    test::write_text(directory.path() / "program" / name, "x");
  }
  sweep_partial_files(directory.path().string(), 0, 4);
  EXPECT_TRUE(std::filesystem::exists(directory.path() / "program" / ours)) << "another shard may be writing it";
  sweep_partial_files(directory.path().string());
  EXPECT_FALSE(std::filesystem::exists(directory.path() / "program" / ours));
  for (const std::string& name : {theirs, std::string("start.gcode"), std::string("start.gcode.part")}) {
    EXPECT_TRUE(std::filesystem::exists(directory.path() / "program" / name)) << name;
  }
}

TEST_F(LoadingMeanwhile, AnotherSplitIsRefused) {
  job.shard = {{0, 4}};
  test::write_text(job.output + "/manifest-1-of-3.json", "{}");
  EXPECT_NE(refusal().find("split otherwise"), std::string::npos);
}

TEST_F(LoadingMeanwhile, NoOtherRunIsNoError) { EXPECT_EQ(refusal(), ""); }

}  // namespace
}  // namespace lamina::pipeline
