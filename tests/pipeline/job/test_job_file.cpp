#include <gtest/gtest.h>

#include "pipeline/job/file.h"
#include "pipeline/job/keys.h"
#include "stages/data/machine.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using test::Directory;

FillChanges changes_of(std::string_view table) {
  FillChanges changes;
  TextPosition at;
  EXPECT_EQ(read_fill_changes(*read_toml_value(table), changes, at), "");
  return changes;
}

// A job in which every key differs from its default.
Job unusual_job(const Directory& directory) {
  Job job;
  job.bed_mm = {123.4567, 0.1 + 0.2};
  job.margin_mm = 7;
  job.dpi = {600, 262.0061};
  job.layer_mm = 1e-6;
  job.gap_mm = 0;
  job.fill_rule = FillRule::kEvenOdd;
  job.mirror = Mirror::kXY;
  job.format = "png";
  job.title = "order 7";
  job.compress_programs = false;
  job.container = Container::kZip;
  job.image_content = ImageContent::kDrops;
  job.slice = {"cli", true, true, 2.5, 0.25, -0.125};
  job.fill.all.gap_mm = {0.1, 0.25};
  job.fill.all.stagger_mm = {0, 0.2};
  job.fill.all.gap_by_height = {{0, 0.75}, {6, 0.1}};
  job.fill.all.density_percent = 35;
  job.fill.all.top_mm = 1;
  job.fill.all.bottom_mm = 0;
  job.fill.all.top_layers = 3;
  job.fill.all.bottom_layers = 0;
  job.fill.all.seam = infill::Seam::kRear;
  job.extrude.brim_mm = 4;
  job.extrude.first_thickness_mm = 0.25;
  job.extrude.first_bead_mm = 0.45;
  job.extrude.elephant_foot_mm = 0.125;
  job.extrude.raft_layers = 2;
  job.extrude.raft_gap_mm = 0.25;
  job.extrude.raft_margin_mm = 4;
  job.fill.ranges = {{1, 2.5, changes_of("{ gap_mm = 0, pattern = 'contour' }")}, {3, 4, {}}};
  job.segment.ranges = {{0, 1.5, {}}};
  job.extrude.material = directory / "own/resin.toml";
  job.extrude.machine = {{"bed.corner_mm", "-110,-110"}, {"fan.from_layer", "2"}};
  job.repair = false;
  job.drop_bad = true;
  job.weld_um = 0.5;
  job.heights = {heights::Mode::kOptimal,
                 "0.05..0.3:0.01",
                 0.07,
                 heights::CuspOf::kNominal,
                 30,
                 80,
                 1e-4,
                 heights::Facets::kPlane,
                 0.5,
                 heights::Peaks::kFacets,
                 true,
                 false,
                 2,
                 3,
                 {12, 0.03},
                 Containment::kInside,
                 true};
  job.machine.profile = "nuferbj";
  job.machine.presets = {"example-sand", directory / "own/binder.toml"};
  job.machine.scan_speed_mm_s = 12.5;
  job.machine.blocked = {{3, 5}};
  job.machine.vat_rule = lamina::VatRule::kFirst;
  job.dose.bleed_um = {20, 30};
  job.dose.hole_bleed_um = {-15, -15};
  job.dose.first_bleed_um = {60, 0};
  job.dose.first_layers = 4;
  job.dose.shell_mm = 0.5;
  job.dose.core = 0.75;
  job.dose.bead_ends = raster::BeadEnds::kSquare;
  job.dose.saturation_percent = 70;
  job.dose.core_saturation_percent = Saturation::of("x < 3 ? 45.5 : min(z, 2)");
  job.dose.saturation_ranges = {{1, 2.5, 80, 60}, {3, 4, Saturation::of("9*x"), Saturation::of("8*y")}};
  job.dose.dithered = false;
  job.levels = 4;
  job.inspect = true;
  job.min_wall_mm = 0.35;
  job.min_drain_mm = 1.25;
  job.support_angle_deg = 52.5;
  job.allow_unbound = true;
  job.output = directory / "out";
  job.engine = Engine::kBoth;
  job.isa = Isa::kPlain;
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
  part.fill = changes_of("{ gap_mm = 0.1, walls = 2 }");
  part.material = "316L";
  part.material_ranges = {{2, 4.5, "bronze"}};
  part.images = {.dpi = {{300, 150}},
                 .layer_mm = 0.125,
                 .threshold = 77,
                 .invert = true,
                 .missing_empty = true,
                 .crop = true,
                 .resample = true};
  part.bleed_um = {{-30, -20}};
  part.hole_bleed_um = {{10, 0}};
  part.saturation_percent = 55;
  part.core_saturation_percent = Saturation::of("33.5-z");
  job.parts = {part, PartRequest{.path = directory / "second.stl"}};
  return job;
}

constexpr Product kProducts[] = {Product::kImages, Product::kContours, Product::kMoves};

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
  ASSERT_EQ(back.fill.ranges.size(), 2u);
  EXPECT_EQ(back.fill.ranges[0].changes.values.pattern, infill::Pattern::kContour);
  EXPECT_EQ(back.extrude.machine, job.extrude.machine);
  for (const Product product : kProducts) EXPECT_EQ(canonical_job_text(back, product), canonical_job_text(job, product));
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
  const std::string text = canonical_job_text(job, Product::kImages);
  EXPECT_EQ(text.find(directory.path().string()), std::string::npos);
  job.output = "elsewhere";
  job.engine = Engine::kContours;
  job.isa = Isa::kAvx2;
  job.threads = 8;
  job.memory_bytes = 1;
  job.layers.reset();
  job.shard = {0, 2};
  job.resume = true;
  job.parts[0].path = "/somewhere/else/" + std::filesystem::path(job.parts[0].path).filename().string();
  EXPECT_EQ(canonical_job_text(job, Product::kImages), text);
}

TEST(JobFile, EveryKeyThatDecidesBytesChangesTheCanonicalText) {
  const Directory directory;
  const Job usual, unusual = unusual_job(directory);
  for (const JobKey& key : job_keys()) {
    for (const Product product : kProducts) {
      // What fills a part and moves a nozzle is as usual here but for a few keys.
      if ((key.decides & bit(product)) == 0 || (product != Product::kImages && key.write(unusual) == key.write(usual)))
        continue;
      Job job = usual;
      ASSERT_EQ(key.read(key.write(unusual), job), "") << key.name;
      EXPECT_NE(canonical_job_text(job, product), canonical_job_text(usual, product)) << key.name;
    }
  }
  Job plain;
  plain.parts.emplace_back();
  for (const PartKey& key : part_keys()) {
    Job job = plain;
    ASSERT_EQ(key.read(key.write(unusual.parts[0]), job.parts[0]), "") << key.name;
    EXPECT_NE(canonical_job_text(job, Product::kImages), canonical_job_text(plain, Product::kImages)) << key.name;
  }
}

TEST(JobFile, EveryKeyIsDocumented) {
  const std::string page = test::read_text(std::string(LAMINA_TEST_DIR) + "/../docs/reference/job.md");
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
      {"[bed]\nsize_mm = [490, nan]\n", ":2:11: bed.size_mm: 'nan'"},
      {"[layers]\nthickness_mm = inf\n", ":2:16: layers.thickness_mm: 'inf'"},
      {"[layers]\nthickness_mm = 0\n", ":2:16: layers.thickness_mm: 0 is out of range"},
      {"[bed]\ndpi = 0\n", ":2:7: bed.dpi: 0 is out of range"},
      {"[bed]\ndpi = 1e9\n", ":2:7: bed.dpi"},
      {"[bed]\nsize_mm = [2148, 1]\n", ":2:11: bed.size_mm: 2148 is out of range"},
      {"[bed]\nsize_mm = [-1, 1]\n", ":2:11: bed.size_mm: -1 is out of range"},
      {"[bed]\n\nsise_mm = [1, 1]\n", ":3:11: bed.sise_mm: no such key; did you mean 'size_mm'?"},
      {"[layer]\nthickness_mm = 1\n", ":1:1: layer: no such section; did you mean 'layers'?"},
      {"bed = 3\n", ":1:7: bed is a section"},
      {"[bed]\nsize_mm = {x = 1}\n", ":2:11: bed.size_mm"},
      {"[bed]\nsize_mm = 1979-05-27\n", ":2:11: bed.size_mm"},
      {"[part]\npath = 'a'\n", ":1:1: part: write one [[part]] table"},
      {"[[part]]\ncopies = 2\n", ":1:1: part.path is missing"},
      {"[[part]]\npath = 'a'\ncopies = 0\n", ":3:10: part.copies: 0 is out of range"},
      {"[[part]]\npath = 'a'\nscale = 0\n", ":3:9: part.scale: 0 is out of range"},
      {"[bed\n", ":1:"},
      {"[image]\nformat = 'tif'\n", ":2:10: image.format: unknown value 'tif'; use one of"},
  };
  for (const auto& [text, reported] : jobs) {
    test::write_text(directory / "job.toml", text);
    Job job;
    const Status status = read_job(directory / "job.toml", job);
    ASSERT_FALSE(status.ok()) << text;
    EXPECT_EQ(status.error().fault, Fault::kUsage) << text;
    EXPECT_NE(status.error().message.find("job.toml" + std::string(reported)), std::string::npos) << status.error().message;
    EXPECT_EQ(status.error().message.find('\n'), std::string::npos) << text;
  }
}

TEST(JobFile, ContoursAndMovesAreDecidedByTheirOwnKeys) {
  Job job;
  job.slice.format = "cli";
  job.parts.emplace_back().path = "a.stl";
  const std::string contours = canonical_job_text(job, Product::kContours), moves = canonical_job_text(job, Product::kMoves);
  for (const char* line : {"[slice]\nformat = \"cli\"\nfile_a_layer = false\n", "tolerance_um = 0\n", "\n[fill]\n"}) {
    EXPECT_NE(contours.find(line), std::string::npos) << line << contours;
  }
  for (const char* text : {"tiff", "dpi", "[segment]", "[dose]", "mirror"}) {
    EXPECT_EQ(contours.find(text), std::string::npos) << text;
    EXPECT_EQ(moves.find(text) == std::string::npos, text != std::string_view("[segment]")) << text;
  }
  EXPECT_EQ(moves.find("format"), std::string::npos);
  Job back;
  ASSERT_TRUE(read_job_text(contours, "manifest.json", back).ok());
  EXPECT_EQ(canonical_job_text(back, Product::kContours), contours);
}

TEST(JobFile, RangesAreTablesAndTheirErrorsNameThePosition) {
  const Directory directory;
  const std::string begin = "[[fill.range]]\nfrom_mm = 2.7\nto_mm = 3\n";
  const auto read = [&](const std::string& text, Job& job) {
    test::write_text(directory / "job.toml", text);
    return read_job(directory / "job.toml", job);
  };
  Job job;
  ASSERT_TRUE(read(begin + "gap_mm = 0\nangle_deg = 90\n[[segment.range]]\nfrom_mm = 1\nto_mm = 2\non = true\n"
                           "[extrude.machine]\nfan.from_layer = 2\n[[part]]\npath = 'a'\nfill = { walls = 2 }\n"
                           "[[part.material_range]]\nfrom_mm = 1\nto_mm = 2\nmaterial = 'tin'\n",
                   job)
                  .ok());
  ASSERT_EQ(job.fill.ranges.size(), 1u);
  FillSettings there;
  apply(job.fill.ranges[0].changes, there);
  EXPECT_EQ(there.angle_deg, 90);
  EXPECT_EQ(job.segment.ranges.at(0).changes.values.on, true);
  EXPECT_EQ(job.parts[0].fill.values.walls, 2u);
  EXPECT_EQ(job.parts[0].material_ranges.at(0).material, "tin");
  EXPECT_EQ(job.extrude.machine.at(0).first, "fan.from_layer");
  const std::pair<std::string, const char*> wrong[] = {
      {begin + "gapp_mm = 0\n", ":4:11: fill.range: 2.7:3: gapp_mm: no such key; did you mean 'gap_mm'?"},
      {begin + "gap_mm = 'x'\n", ":4:10: fill.range: 2.7:3: gap_mm: 'x' is not a finite number"},
      {begin + "[[fill.range]]\nfrom_mm = 1\nto_mm = 2.8\n", ": fill.range: 1:2.8 overlaps 2.7:3"},
      {"[[fill.range]]\nfrom_mm = 2\n", ": fill.range: to_mm is missing"},
      {"[[fill.range]]\nfrom_mm = 2\nto_mm = 1\n", ": fill.range: 2:1 ends at or below its start"},
      {"[fill]\nrange = 3\n", ":2:9: fill.range: is an array of tables"},
      {"[fill]\ngap_by_height = [[0, 0.75], [0, 0.1]]\n", ":2:29: fill.gap_by_height: [0, 0.1]: heights have to increase"},
      {"[[part]]\npath = 'a'\nfill = { gap_mm = 1, distance_mm = 1 }\n", "both say how far lines lie from each other"},
  };
  for (const auto& [text, reported] : wrong) {
    Job bad;
    const Status status = read(text, bad);
    ASSERT_FALSE(status.ok()) << text;
    EXPECT_NE(status.error().message.find(reported), std::string::npos) << status.error().message;
  }
}

TEST(JobFile, RenamedKeyNamesTheNewOne) {
  for (const auto& [assignment, renamed] : {std::pair{"fill.by_height=2.7:3 gap_mm=0", "is now fill.range"},
                                            {"segment.by_height=2.7:3 thin_mm=2", "is now segment.range"},
                                            {"part.material_by_height=2:4 bronze", "is now part.material_range"},
                                            {"extrude.set=fan.from_layer=2", "is now extrude.machine"},
                                            {"run.least_wall_mm=1", "is now run.min_wall_mm"},
                                            {"segment.least_end_mm=1", "is now segment.min_end_mm"},
                                            {"place.gap_mm=1", "is now [placement]"}}) {
    Job job;
    job.parts.emplace_back();
    const Status status = set_key(job, assignment);
    ASSERT_FALSE(status.ok()) << assignment;
    EXPECT_NE(status.error().message.find(renamed), std::string::npos) << status.error().message;
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
  EXPECT_EQ(job.dpi, (std::array<double, 2>{1200, 600}));
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
  EXPECT_TRUE(refused([](Job& j) { j.dpi = {1200, 0}; }));
  EXPECT_TRUE(refused([](Job& j) { j.layer_mm = std::numeric_limits<double>::quiet_NaN(); }));
  EXPECT_TRUE(refused([](Job& j) { j.bed_mm = {1e9, 380}; }));
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
