// lamina export: what is written is what would be planned.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "stages/load/load.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// All triangles of a file in nm, beginning with their smallest corner, sorted, moved so that their box begins at 0.
std::vector<Triangle> triangles_of(const std::string& path) {
  const Result<Part> part = load::load(path, {});
  EXPECT_TRUE(part.ok()) << part.error().message;
  std::vector<Triangle> all;
  if (!part) return all;
  const Point3 from = part->bounds.lo;
  for (const Instance& instance : part->instances) {
    for (const Triangle& t : part->meshes[instance.mesh].triangles) {
      std::array corners{t.a, t.b, t.c};
      for (Point3& p : corners) {
        p = {p.x + instance.offset.x - from.x, p.y + instance.offset.y - from.y, p.z + instance.offset.z - from.z};
      }
      std::rotate(corners.begin(), std::ranges::min_element(corners), corners.end());
      all.push_back({corners[0], corners[1], corners[2]});
    }
  }
  std::ranges::sort(all, {}, [](const Triangle& t) { return std::array{t.a, t.b, t.c}; });
  return all;
}

class Export : public ::testing::Test {
 protected:
  Outcome run(const std::string& line) { return run_lamina(words_of(line), directory_.path()); }
  Json done(const std::string& line) {
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  void refused(const std::string& line, int code, const std::string& words) { expect_refused(line, code, words, directory_); }
  std::string layers_of(const std::string& line, const std::string& directory) {
    done(line + " --bed 90x60 --dpi 300 --layer 0.5 --quiet -o " + directory);
    return tree_text(directory_.path() / directory / "layers");
  }

  Directory directory_;
};

TEST_F(Export, ThreeMfKeepsEveryTriangleAndEveryPixel) {
  const std::string nut = corpus_file("parameter_quality_nut.stl");
  const Json json = done("export " + nut + " --rotate 10,20,30 --shrink 1.02,1.01,1.03 --bed 90x60 -o nut.3mf --json --quiet");
  EXPECT_EQ(json["format"], "3mf");
  EXPECT_EQ(json["rounding_mm"], 0);
  done("export nut.3mf --bed 90x60 -o again.3mf --quiet");
  const auto once = triangles_of(directory_ / "nut.3mf");
  EXPECT_EQ(once.size(), json["triangles"].get<std::size_t>());
  EXPECT_TRUE(once == triangles_of(directory_ / "again.3mf"));
  EXPECT_TRUE(layers_of("jet " + nut + " --rotate 10,20,30 --shrink 1.02,1.01,1.03", "a") == layers_of("jet nut.3mf", "b"));
}

TEST_F(Export, StlKeepsWhatFloatsHold) {
  write_box(directory_ / "block.stl", {0, 0, 0}, {20, 10, 5.25f});
  const Json json = done("export block.stl --bed 64x64 -o out.stl --json --quiet");  // moved by 22 and 27 mm
  EXPECT_EQ(json["triangles"], 12);
  EXPECT_EQ(json["rounding_mm"], 0);
  EXPECT_NEAR(json["volume_mm3"].get<double>(), 20 * 10 * 5.25, 1e-9);
  EXPECT_TRUE(triangles_of(directory_ / "block.stl") == triangles_of(directory_ / "out.stl"));
  EXPECT_TRUE(layers_of("jet block.stl", "a") == layers_of("jet out.stl", "b"));
  const Json far = done("export block.stl --at 300.1,200.1 -o far.stl --json --quiet");
  EXPECT_GT(far["rounding_mm"].get<double>(), 1e-6);
  EXPECT_LT(far["rounding_mm"].get<double>(), 2e-5);
}

TEST_F(Export, CopiesAreWhereTheyArePlanned) {
  write_box(directory_ / "block.stl", {0, 0, 0}, {20, 10, 5});
  const Json json = done("export block.stl --copies 5 --bed 90x60 -o bed.3mf --json --quiet");
  EXPECT_EQ(json["meshes"], 1);
  EXPECT_EQ(json["instances"], 5);
  EXPECT_EQ(triangles_of(directory_ / "bed.3mf").size(), 60u);
  EXPECT_TRUE(layers_of("jet block.stl --copies 5", "a") == layers_of("jet bed.3mf", "b"));
}

TEST_F(Export, RepairsAreWrittenAndReported) {
  write_box(directory_ / "open.stl", {0, 0, 0}, {20, 10, 5});
  std::string bytes = read_text(directory_.path() / "open.stl");
  bytes.resize(bytes.size() - 50);
  bytes[80] = 11;  // facets
  write_text(directory_.path() / "open.stl", bytes);
  const Json json = done("export open.stl -o closed.stl --json --quiet");
  EXPECT_EQ(json["triangles"], 12);
  EXPECT_EQ(json["parts"][0]["notes"][0]["repair"], true);
  EXPECT_NE(run("export open.stl -o twice.3mf").err.find("repair: "), std::string::npos);
  EXPECT_NE(run("info closed.stl").out.find("closed"), std::string::npos);
  EXPECT_EQ(done("export closed.stl -o again.stl --json --quiet")["parts"][0]["notes"].size(), 0u);
}

TEST_F(Export, NothingIsReplacedUnrequested) {
  write_box(directory_ / "part.stl", {0, 0, 0}, {20, 10, 5});
  write_text(directory_ / "mine.stl", "precious\n");
  fs::create_symlink("part.stl", directory_ / "link.stl");
  refused("export part.stl", 2, "-o FILE is missing");
  refused("export -o new.stl", 2, "no part");
  refused("export part.stl -o new.obj", 2, ".stl or .3mf");
  refused("export part.stl -o mine.stl", 2, "--overwrite");
  refused("export part.stl -o part.stl --overwrite", 2, "is read by this call");
  refused("export part.stl -o link.stl --overwrite", 2, "is read by this call");
  refused("export part.stl --scale 100 -o new.stl", 2, "bed");
  refused("export absent.stl -o new.stl", 3, "absent.stl");
  done("export part.stl -o mine.stl --overwrite --quiet");
  EXPECT_EQ(triangles_of(directory_ / "mine.stl").size(), 12u);
}

TEST_F(Export, StreamsStlToStandardOutput) {
  write_box(directory_ / "part.stl", {0, 0, 0}, {20, 10, 5});
  const Outcome streamed = run("export part.stl -o - --quiet");
  EXPECT_EQ(streamed.code, 0) << streamed.err;
  done("export part.stl -o file.stl --quiet");
  EXPECT_TRUE(streamed.out == read_text(directory_.path() / "file.stl"));
  EXPECT_FALSE(fs::exists(directory_.path() / "-"));
  EXPECT_EQ(run("export part.stl -o /dev/null --quiet").code, 0);
}

}  // namespace
}  // namespace lamina::test
