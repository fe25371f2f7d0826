// tests/pipeline/cache/test_job_key.cpp: the key has all that decides bytes, and no names.
#include "pipeline/cache/job_key.h"

#include <gtest/gtest.h>

#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using test::Directory;

class JobKeys : public ::testing::Test {
 protected:
  JobKeys() {
    test::write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3});
    job_.parts.push_back({directory_ / "part.stl"});
    job_.output = directory_ / "out";
  }

  Hash128 key(const Job& job, Product product = Product::kImages) {
    InputDigests inputs;
    const auto resolved = resolve(job, product);
    EXPECT_TRUE(resolved.ok()) << (resolved ? "" : resolved.error().message);
    const JobKey128 found = job_key(*resolved, inputs);
    EXPECT_TRUE(found.key) << found.reason;
    return found.key.value_or(Hash128());
  }

  /// The key of the job with "section.key=value".
  Hash128 with(const std::string& assignment, Product product = Product::kImages) {
    Job job = job_;
    EXPECT_TRUE(set_key(job, assignment).ok()) << assignment;
    return key(job, product);
  }

  Directory directory_;
  Job job_;
};

TEST_F(JobKeys, NamesAndRunsAreNotInTheKey) {
  const Hash128 one = key(job_);
  std::filesystem::copy_file(directory_ / "part.stl", directory_ / "copy.stl");
  Job other = job_;
  other.parts[0].path = directory_ / "copy.stl";
  other.output = directory_ / "elsewhere";
  other.threads = 3;
  other.memory_bytes = 1 << 28;
  other.sync = Sync::kOff;
  other.engine = Engine::kContours;
  EXPECT_EQ(key(other), one);
}

TEST_F(JobKeys, WhatDecidesBytesIsInTheKey) {
  const Hash128 one = key(job_);
  for (const char* assignment :
       {"bed.dpi=600", "bed.size_mm=[100, 100]", "layers.thickness_mm=0.07", "image.format=\"png\"", "image.mirror=\"x\"",
        "image.fill=\"evenodd\"", "dose.bleed_um=[10, 10]", "part.copies=2", "part.rotate_deg=[0, 0, 10]", "part.unit=\"inch\"",
        "part.bottom_mm=1", "run.layers=\"0:2\"", "image.title=\"a title\""}) {
    EXPECT_NE(with(assignment), one) << assignment;
  }
  test::write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3.001f});
  EXPECT_NE(key(job_), one);
  EXPECT_NE(key(job_, Product::kMoves), one);
}

TEST_F(JobKeys, TextsOfProfilesAreInTheKeyAndTheirNamesAreNot) {
  const std::string text = "inherits = \"jet1000\"\n[motion]\nscan_speed_mm_s = 200\n";
  test::write_text(directory_ / "mine.toml", text);
  test::write_text(directory_ / "same.toml", text);
  test::write_text(directory_ / "other.toml", "inherits = \"jet1000\"\n[motion]\nscan_speed_mm_s = 201\n");
  const auto of = [&](const std::string& name) {
    Job job = job_;
    job.machine.profile = directory_ / name;
    return key(job);
  };
  EXPECT_EQ(of("mine.toml"), of("same.toml"));
  EXPECT_NE(of("mine.toml"), of("other.toml"));
}

TEST_F(JobKeys, NamesOfPartsAreInTheKeyOfToolpathsThatContainThem) {
  std::filesystem::copy_file(directory_ / "part.stl", directory_ / "copy.stl");
  Job other = job_;
  other.parts[0].path = directory_ / "copy.stl";
  EXPECT_NE(key(other, Product::kMoves), key(job_, Product::kMoves));
  other.parts[0].path = job_.parts[0].path;
  other.output = directory_ / "other.gcode";
  EXPECT_EQ(key(other, Product::kMoves), key(job_, Product::kMoves));
}

TEST_F(JobKeys, JobsWithoutOneResultAreNotCached) {
  InputDigests inputs;
  const auto reason = [&](const Job& job, Product product) { return job_key(*resolve(job, product), inputs).reason; };
  Job job = job_;
  job.dry_run = true;
  EXPECT_NE(reason(job, Product::kImages), "");
  job = job_;
  job.engine = Engine::kBoth;
  EXPECT_NE(reason(job, Product::kImages), "");
  job = job_;
  job.shard = {{0, 2}};
  EXPECT_NE(reason(job, Product::kImages), "");
  job = job_;
  job.parts[0].path = directory_ / "absent.stl";
  EXPECT_NE(reason(job, Product::kImages), "");
  EXPECT_NE(reason(job_, Product::kContours), "");
}

}  // namespace
}  // namespace lamina::pipeline
