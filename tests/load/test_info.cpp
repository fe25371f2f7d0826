// tests/load/test_info.cpp: the report of `lamina info`.
#include "pipeline/report/part_info.h"

#include <algorithm>
#include <array>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>

#include "stages/slice/slice.h"
#include "tests/load/archives.h"
#include "tests/load/broken_files.h"

namespace lamina::test {
namespace {

std::string text_of(const std::string& path, const load::LoadOptions& options = {}) {
  const Result<std::string> text = pipeline::describe_part_text(path, options, slice::surplus_areas);
  EXPECT_TRUE(text.ok()) << text.error().message;
  return text ? *text : "";
}

nlohmann::json json_of(const std::string& path) {
  const Result<std::string> text = pipeline::describe_part_json(path, {}, slice::surplus_areas);
  EXPECT_TRUE(text.ok()) << text.error().message;
  return text ? nlohmann::json::parse(*text) : nlohmann::json();
}

TEST(Info, ACleanPartIsPlannedAsItIs) {
  const std::string text = text_of(corpus("nist_am_test_artifact_v3b.stl"));
  EXPECT_CONTAINS(text, "format               binary STL");
  EXPECT_CONTAINS(text, "triangles            7 392");
  EXPECT_CONTAINS(text, "size                 141.421 x 141.421 x 17.000 mm");
  EXPECT_CONTAINS(text, "volume               100981 mm3");
  EXPECT_CONTAINS(text, "closed               yes");
  EXPECT_CONTAINS(text, "lamina jet plans it as it is.");
  EXPECT_EQ(text.find("found"), text.npos);
  EXPECT_EQ(text.back(), '\n');
}

TEST(Info, ABrokenPartSaysWhereAndWhatWillBeDone) {
  const std::string text = text_of(corpus("broken/cube_missing_corner.stl"));
  EXPECT_CONTAINS(text, "closed               no");
  EXPECT_CONTAINS(text, "open edges                    6  (");
  EXPECT_CONTAINS(text, "lamina jet plans it after these changes:");
  EXPECT_CONTAINS(text, "1 opening capped with 4 triangles");
  load::LoadOptions options;
  options.repair = false;
  EXPECT_CONTAINS(text_of(corpus("broken/cube_missing_corner.stl"), options), "since repair is off");
}

TEST(Info, ReportsTheVolumeThatIsPlannedAndWhatHangsOnCaps) {
  EXPECT_CONTAINS(text_of(corpus("nist_am_test_artifact_v3b.stl")), "planned volume       100981 mm3\n");
  std::vector<FloatTriangle> open = unit_box();
  open.resize(10);  // without the face at x = 10, 600 of 2200 mm2
  const std::string path = write_file("open.stl", binary_stl(open));
  EXPECT_CONTAINS(text_of(path), "planned volume       6000 mm3, 27.3 % of the surface is caps");
  const nlohmann::json json = json_of(path);
  EXPECT_NEAR(json["planned_volume_mm3"].get<double>(), 6000, 1e-6);
  EXPECT_NEAR(json["capped_share"].get<double>(), 600.0 / 2200, 1e-9);
}

/// What is planned of facets, and how well it is known.
std::pair<double, std::string> planned(const Facets& facets) {
  const nlohmann::json json = json_of(write_file("shells.stl", binary_stl(facets)));
  EXPECT_EQ(json["meshes"][0]["planned_volume_mm3"], json["planned_volume_mm3"]);
  return {json["planned_volume_mm3"].get<double>(), json["planned_volume_is"].get<std::string>()};
}

TEST(Info, ShellsThatOverlapArePlannedOnce) {
  const Facets &box = unit_box(), inner = moved(scaled(box, 0.5f), 2, 2, 2);  // 10 x 20 x 30, and an eighth of it
  const auto expect = [](const Facets& facets, double mm3, const char* known) {
    const auto [volume, is] = planned(facets);
    EXPECT_NEAR(volume, mm3, 1e-6 * mm3);
    EXPECT_EQ(is, known);
  };
  expect(joined(box, moved(box, 5, 10, 15)), 12000 - 5 * 10 * 15, "integrated");
  expect(joined(box, inner), 6000, "integrated");
  expect(joined(joined(box, inner), inside_out(inner)), 6000, "exact");
  expect(joined(box, inside_out(inner)), 6000 - 750, "exact");
  expect(joined(box, moved(box, 10, 0, 0)), 12000, "exact");
  expect(joined(box, inside_out(moved(inner, 40, 0, 0))), 6000 + 750, "exact");
}

TEST(Info, RoundShellsThatOverlapArePlannedOnce) {
  // Two balls of radius 8 whose centres are 8 apart: 5 pi r^3 / 12 in common.
  const double r = 8, alone = 4 * std::numbers::pi / 3 * r * r * r, common = 5 * std::numbers::pi / 12 * r * r * r;
  for (const auto& [x, y, z] : {std::array{8.f, 0.f, 0.f}, std::array{0.f, 0.f, 8.f}}) {
    const auto [volume, is] = planned(joined(ball(8, 48), moved(ball(8, 48), x, y, z)));
    EXPECT_NEAR(volume, 2 * alone - common, 0.005 * alone) << "the balls have facets";
    EXPECT_EQ(is, "integrated");
  }
}

TEST(Info, ObjectsThatOverlapArePlannedOnce) {
  const std::string path =
      write_file("two.3mf", zip(package(model(box_object(1, 10, 20, 30), item(1) + item(1, "1 0 0 0 1 0 0 0 1 5 10 15")))));
  const nlohmann::json json = json_of(path);
  EXPECT_NEAR(json["planned_volume_mm3"].get<double>(), 12000 - 750, 0.01);
  EXPECT_NEAR(json["meshes"][0]["planned_volume_mm3"].get<double>(), 6000, 1e-6);
  EXPECT_CONTAINS(text_of(path), "planned volume       about 11250 mm3\n");
  const Result<std::string> unsliced = pipeline::describe_part_text(path, {});
  ASSERT_TRUE(unsliced.ok());
  EXPECT_CONTAINS(*unsliced, "planned volume       12000 mm3 (what overlaps counts as often as it does)\n");
}

/// So many boxes of 20 mm, each a little higher than the one before, as one mesh.
Mesh stairs(std::int32_t boxes, load::Diagnosis& found) {
  Mesh mesh;
  const Nm side = 20'000'000;
  for (std::int32_t i = 0; i < boxes; ++i) {
    const Nm z = i * 1000;
    const auto corner = [&](int at) { return Point3{at & 1 ? side : 0, at & 2 ? side : 0, at & 4 ? z + side : z}; };
    for (const auto& [a, b, c] : {std::array{0, 2, 1},
                                  {1, 2, 3},
                                  {4, 5, 6},
                                  {5, 7, 6},
                                  {0, 1, 4},
                                  {1, 5, 4},
                                  {2, 6, 3},
                                  {3, 6, 7},
                                  {0, 4, 2},
                                  {2, 4, 6},
                                  {1, 3, 5},
                                  {3, 7, 5}}) {
      mesh.triangles.push_back({corner(a), corner(b), corner(c)});
    }
    found.shell_ends.insert(found.shell_ends.end(), {z, z + side});
    found.volume_mm3 += 8000;
  }
  mesh.bounds = {{0, 0, 0}, {side, side, side + boxes * 1000}};
  found.shells_apart = false;
  return mesh;
}

TEST(Info, ManyShellsThatOverlapTakeBoundedWork) {
  const Instance alone{0, {0, 0, 0}};
  for (const std::int32_t boxes : {20, 2000}) {
    load::Diagnosis found;
    const Mesh mesh = stairs(boxes, found);
    double crossed = 0;
    std::size_t count = 0;
    const load::SurplusAreas counting = [&](auto meshes, auto, std::span<const Nm> planes) -> Result<std::vector<double>> {
      EXPECT_TRUE(std::ranges::adjacent_find(planes, std::ranges::greater_equal()) == planes.end()) << "they rise";
      const auto below = [&](Nm z) { return std::ranges::lower_bound(planes, z) - planes.begin(); };
      for (const Triangle& t : meshes[0].triangles) {
        const auto [low, high] = std::minmax({t.a.z, t.b.z, t.c.z});
        crossed += static_cast<double>(below(high) - below(low));
      }
      count = planes.size();
      return std::vector<double>(planes.size(), -400.0);
    };
    for (const load::Effort effort : {load::Effort{}, load::Effort{1e6, 4}}) {
      crossed = 0;
      const auto volumes =
          load::planned_volumes(std::span(&mesh, 1), std::span(&alone, 1), std::span(&found, 1), counting, effort);
      ASSERT_TRUE(volumes.ok());
      EXPECT_EQ(volumes->all.known, load::Known::kAbout);
      EXPECT_LE(crossed, effort.max_crossed);
      EXPECT_GE(static_cast<double>(count), effort.fewest_planes);
      const double height_mm = 20 + (boxes - 1) * 1e-3;
      EXPECT_NEAR(volumes->all.mm3, boxes * 8000.0 - 400 * height_mm, 1e-3) << "the weights add up to the height";
    }
  }
  load::Diagnosis found;
  const Mesh mesh = stairs(2000, found);
  const auto none = [](auto, auto, auto) -> Result<std::vector<double>> { return Error{Fault::kInternal, "called"}; };
  const auto volumes =
      load::planned_volumes(std::span(&mesh, 1), std::span(&alone, 1), std::span(&found, 1), none, load::Effort{1e5, 16});
  ASSERT_TRUE(volumes.ok());
  EXPECT_EQ(volumes->all.known, load::Known::kSummed);
}

TEST(Info, JsonHasTheSameNumbers) {
  const nlohmann::json clean = json_of(corpus("cube_gears_17_items.3mf"));
  EXPECT_EQ(clean["format"], "3MF");
  EXPECT_EQ(clean["items"], 17);
  EXPECT_EQ(clean["triangles"], 25692);
  EXPECT_EQ(clean["closed"], true);
  EXPECT_EQ(clean["meshes"].size(), 17u);
  EXPECT_NEAR(clean["volume_mm3"].get<double>(), 112366, 1);
  const nlohmann::json broken = json_of(corpus("broken/nist_duplicate_facets.stl"));
  EXPECT_EQ(broken["closed"], false);
  EXPECT_EQ(broken["meshes"][0]["duplicate_facets"]["count"], 1338);
  EXPECT_EQ(broken["meshes"][0]["duplicate_facets"]["first"].size(), 3u);
  EXPECT_EQ(broken["repairs"].size(), 1u);
}

TEST(Info, AFileThatCannotBePlannedIsAnError) {
  const Result<std::string> text = pipeline::describe_part_text(corpus("broken/plane_flat.stl"), {});
  ASSERT_FALSE(text.ok());
  EXPECT_EQ(text.error().fault, Fault::kInput);
  EXPECT_FALSE(pipeline::describe_part_json(corpus("broken/empty_file.stl"), {}).ok());
}

TEST(Info, EveryPartOfTheCorpusIsDescribed) {
  std::size_t described = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(corpus(""))) {
    const std::string path = entry.path().string();
    if (!load::load(path, {}).ok()) continue;
    EXPECT_FALSE(text_of(path).empty());
    EXPECT_FALSE(json_of(path).empty());
    ++described;
  }
  EXPECT_GT(described, 25u);
}

}  // namespace
}  // namespace lamina::test
