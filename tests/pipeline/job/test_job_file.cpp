#include <gtest/gtest.h>

#include "pipeline/job/file.h"
#include "pipeline/job/keys.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using test::Directory;

// A job in which every key differs from its default.
Job unusual_job(const Directory& directory) {
  Job job;
  job.bed_mm = {123.4567, 0.1 + 0.2};
  job.dpi = {600, 300};
  job.layer_mm = 1e-6;
  job.gap_mm = 0;
  job.fill_rule = FillRule::kEvenOdd;
  job.mirror = Mirror::kXY;
  job.format = "png";
  job.slice = {"cli", true, true, 2.5, 0.25, -0.125};
  job.fill.all.gap_mm = {0.1, 0.25};
  job.fill.all.stagger_mm = {0, 0.2};
  job.fill.by_height = "1:2 gap_mm=0";
  job.repair = false;
  job.drop_bad = true;
  job.weld_um = 0.5;
  job.heights = {heights::Mode::kOptimal,
                 "0.05..0.3:0.01",
                 0.07,
                 30,
                 80,
                 1e-4,
                 heights::Facets::kPlane,
                 0.5,
                 false,
                 2,
                 3,
                 {12, 0.03},
                 Containment::kInside,
                 true};
  job.machine.profile = "nuferbj";
  job.machine.bed_given = job.machine.dpi_given = true;
  job.machine.scan_speed_mm_s = 12.5;
  job.machine.blocked = {{3, 5}};
  job.dose = {{20, 30}, 0.5, 0.75, raster::BeadEnds::kSquare};
  job.output = directory / "out";
  job.engine = Engine::kBoth;
  job.threads = 3;
  job.memory_bytes = 1234567;
  job.layers = {4, UINT32_MAX};
  PartRequest part;
  part.path = directory / "a \"quoted\" \\ \xc3\xa9 \n name.stl";
  part.unit = "inch";
  part.copies = 17;
  part.at_mm = {0.25, 1e-5};
  part.bottom_mm = 3;
  part.scale = {1.0 / 3, 2, -1};
  part.rotate_deg = {-90, 0.1, 359};
  part.shrink = {1.02, 1.02, 1.025};
  part.fill = "gap_mm=0.1 walls=2";
  part.material = "316L";
  part.material_by_height = "2:4.5 bronze";
  job.parts = {part, PartRequest{.path = directory / "second.stl"}};
  return job;
}

std::string all_of(const Job& job) { return job_text(job, ""); }

TEST(JobFile, SavedJobReadsBackAsTheSameJob) {
  const Directory directory;
  const Job job = unusual_job(directory);
  ASSERT_TRUE(save_job(directory / "job.toml", job).ok());
  Job back;
  const Status status = read_job(directory / "job.toml", back);
  ASSERT_TRUE(status.ok()) << status.error().message;
  EXPECT_EQ(all_of(back), all_of(job));
  EXPECT_EQ(back.parts[0].path, job.parts[0].path);
  EXPECT_EQ(back.bed_mm, job.bed_mm);
  EXPECT_EQ(back.parts[0].scale, job.parts[0].scale);
  EXPECT_EQ(back.layers, job.layers);
  EXPECT_EQ(canonical_job_text(back), canonical_job_text(job));
}

TEST(JobFile, ShardIsKept) {
  const Directory directory;
  Job job;
  job.shard = {1, 4};
  ASSERT_TRUE(save_job(directory / "job.toml", job).ok());
  Job back;
  ASSERT_TRUE(read_job(directory / "job.toml", back).ok());
  EXPECT_EQ(back.shard, job.shard);
}

TEST(JobFile, PathsAreRelativeToTheFile) {
  const Directory directory;
  std::filesystem::create_directory(directory / "sub");
  test::write_text(directory / "sub/job.toml",
                   "[run]\noutput = 'out'\n[[part]]\npath = 'a.stl'\n[[part]]\npath = '../b.stl'\n[[part]]\npath = '/c.stl'\n");
  Job job;
  ASSERT_TRUE(read_job(directory / "sub/job.toml", job).ok());
  EXPECT_EQ(job.parts[0].path, directory / "sub/a.stl");
  EXPECT_EQ(job.parts[1].path, directory / "b.stl");
  EXPECT_EQ(job.parts[2].path, "/c.stl");
  EXPECT_EQ(job.output, directory / "sub/out");
}

TEST(JobFile, CanonicalTextHasNoPathsAndNothingThatLeavesBytesAlone) {
  const Directory directory;
  Job job = unusual_job(directory);
  const std::string text = canonical_job_text(job);
  EXPECT_EQ(text.find(directory.path().string()), std::string::npos);
  job.output = "elsewhere";
  job.engine = Engine::kContours;
  job.threads = 8;
  job.memory_bytes = 1;
  job.layers.reset();
  job.shard = {0, 2};
  job.resume = true;
  job.parts[0].path = "/somewhere/else/" + std::filesystem::path(job.parts[0].path).filename().string();
  EXPECT_EQ(canonical_job_text(job), text);
}

TEST(JobFile, EveryKeyThatDecidesBytesChangesTheCanonicalText) {
  const Directory directory;
  const Job usual, unusual = unusual_job(directory);
  for (const JobKey& key : job_keys()) {
    if (!key.decides_bytes) continue;
    Job job = usual;
    ASSERT_EQ(key.read(key.write(unusual), job), "") << key.name;
    EXPECT_NE(canonical_job_text(job), canonical_job_text(usual)) << key.name;
  }
  Job plain;
  plain.parts.emplace_back();
  for (const PartKey& key : part_keys()) {
    Job job = plain;
    ASSERT_EQ(key.read(key.write(unusual.parts[0]), job.parts[0]), "") << key.name;
    EXPECT_NE(canonical_job_text(job), canonical_job_text(plain)) << key.name;
  }
}

TEST(JobFile, EveryKeyIsDocumented) {
  const std::string page = test::read_text(std::string(LAMINA_TEST_DIR) + "/../docs/job.md");
  ASSERT_FALSE(page.empty());
  const auto documented = [&](std::string_view section, std::string_view name, std::string_view flag) {
    const std::string row = "| `" + std::string(section) + "." + std::string(name) + "` |";
    const std::size_t at = page.find(row);
    EXPECT_NE(at, std::string::npos) << row;
    if (at == std::string::npos || flag.empty()) return;
    const std::string line = page.substr(at, page.find('\n', at) - at);
    EXPECT_NE(line.find(flag.substr(0, flag.find(','))), std::string::npos) << flag;
  };
  for (const JobKey& key : job_keys()) documented(key.section, key.name, key.flag);
  for (const PartKey& key : part_keys()) documented(key.section, key.name, key.flag);
}

TEST(JobFile, WrongKeysAndValuesNameFileLineAndKey) {
  const Directory directory;
  const std::pair<const char*, const char*> jobs[] = {
      {"[bed]\nsize_mm = [490, nan]\n", ":2: bed.size_mm: 'nan'"},
      {"[layers]\nthickness_mm = inf\n", ":2: layers.thickness_mm: 'inf'"},
      {"[layers]\nthickness_mm = 0\n", ":2: layers.thickness_mm: 0 is out of range"},
      {"[bed]\ndpi = 0\n", ":2: bed.dpi: 0 is out of range"},
      {"[bed]\ndpi = 1e9\n", ":2: bed.dpi"},
      {"[bed]\nsize_mm = [2148, 1]\n", ":2: bed.size_mm: 2148 is out of range"},
      {"[bed]\nsize_mm = [-1, 1]\n", ":2: bed.size_mm: -1 is out of range"},
      {"[bed]\n\nsise_mm = [1, 1]\n", ":3: bed.sise_mm: no such key; did you mean 'size_mm'?"},
      {"[layer]\nthickness_mm = 1\n", ":1: layer: no such section; did you mean 'layers'?"},
      {"bed = 3\n", ":1: bed is a section"},
      {"[bed]\nsize_mm = {x = 1}\n", ":2: bed.size_mm"},
      {"[bed]\nsize_mm = 1979-05-27\n", ":2: bed.size_mm"},
      {"[part]\npath = 'a'\n", ":1: part: write one [[part]] table"},
      {"[[part]]\ncopies = 2\n", ":1: part.path is missing"},
      {"[[part]]\npath = 'a'\ncopies = 0\n", ":3: part.copies: 0 is out of range"},
      {"[[part]]\npath = 'a'\nscale = 0\n", ":3: part.scale: 0 is out of range"},
      {"[bed\n", ":1:"},
      {"[image]\nformat = 'tif'\n", ":2: image.format: 'tif' is none of"},
  };
  for (const auto& [text, told] : jobs) {
    test::write_text(directory / "job.toml", text);
    Job job;
    const Status status = read_job(directory / "job.toml", job);
    ASSERT_FALSE(status.ok()) << text;
    EXPECT_EQ(status.error().fault, Fault::kUsage) << text;
    EXPECT_NE(status.error().message.find("job.toml" + std::string(told)), std::string::npos) << status.error().message;
    EXPECT_EQ(status.error().message.find('\n'), std::string::npos) << text;
  }
}

TEST(JobFile, SetTakesValuesAsFilesAndOptionsDo) {
  Job job;
  job.parts.resize(2);
  for (const char* assignment : {"bed.dpi=1200x600", "bed.size_mm=[100, 50]", "image.format=\"png\"", "part.copies=3",
                                 "part.2.scale=2", "run.memory=64M"}) {
    const Status status = set_key(job, assignment);
    EXPECT_TRUE(status.ok()) << status.error().message;
  }
  EXPECT_EQ(job.dpi, (std::array<std::int64_t, 2>{1200, 600}));
  EXPECT_EQ(job.bed_mm, (std::array<double, 2>{100, 50}));
  EXPECT_EQ(job.format, "png");
  EXPECT_EQ(job.parts[0].copies, 3u);
  EXPECT_EQ(job.parts[0].scale[0], 1);
  EXPECT_EQ(job.parts[1].scale[2], 2);
  EXPECT_EQ(job.memory_bytes, 64u << 20);
  for (const char* assignment : {"bed.dpi", "dpi=3", "bed.dpi=", "bed.dpi=nan", "bed.nothing=1", "nothing.dpi=1", "=", "",
                                 "part.3.copies=1", "part.0.copies=1", "bed.dpi.x=1", "...=1", "bed.dpi=["}) {
    const Status status = set_key(job, assignment);
    EXPECT_FALSE(status.ok()) << assignment;
  }
}

TEST(Job, LayersAreSharedOutWithoutGapOrOverlap) {
  for (const std::uint32_t count : {1u, 7u, 100u, 4'000'000'000u}) {
    for (const std::uint32_t shards : {1u, 2u, 7u, 150u}) {
      std::uint32_t next = 0;
      for (std::uint32_t i = 0; i < shards; ++i) {
        Job job;
        job.shard = {i, shards};
        const auto range = layer_range(job, count);
        ASSERT_TRUE(range.ok());
        EXPECT_EQ(range->front(), next);
        EXPECT_LE(range->back() - range->front(), count / shards + 1);
        next = range->back();
      }
      EXPECT_EQ(next, count);
    }
  }
  Job job;
  job.layers = {3, UINT32_MAX};
  EXPECT_EQ(*layer_range(job, 10), (std::array<std::uint32_t, 2>{3, 10}));
  EXPECT_EQ(layer_range(job, 3).error().fault, Fault::kUsage);
}

TEST(Job, ValuesThatCameFromElsewhereAreChecked) {
  Job job;
  job.parts.resize(1);
  job.parts[0].path = "a";
  job.output = "out";
  EXPECT_TRUE(check_job(job).ok());
  const auto refused = [&](const auto& change) {
    Job bad = job;
    change(bad);
    const Status status = check_job(bad);
    return !status.ok() && status.error().fault == Fault::kUsage;
  };
  EXPECT_TRUE(refused([](Job& j) { j.dpi[1] = 0; }));
  EXPECT_TRUE(refused([](Job& j) { j.layer_mm = std::numeric_limits<double>::quiet_NaN(); }));
  EXPECT_TRUE(refused([](Job& j) { j.bed_mm[0] = 1e9; }));
  EXPECT_TRUE(refused([](Job& j) { j.parts[0].scale[2] = 0; }));
  EXPECT_TRUE(refused([](Job& j) { j.parts[0].at_mm = {-1.0, 0.0}; }));
  EXPECT_TRUE(refused([](Job& j) { j.parts.clear(); }));
  EXPECT_TRUE(refused([](Job& j) { j.output.clear(); }));
  EXPECT_TRUE(refused([](Job& j) { j.format = "jpeg"; }));
  EXPECT_TRUE(refused([](Job& j) { j.layers = {0, 1}, j.shard = {0, 2}; }));
  EXPECT_TRUE(refused([](Job& j) { j.resume = j.overwrite = true; }));
}

}  // namespace
}  // namespace lamina::pipeline
