// tests/load/test_info.cpp: the report of `lamina info`.
#include "stages/load/info/info.h"

#include <nlohmann/json.hpp>

#include "tests/load/files.h"

namespace lamina::test {
namespace {

std::string text_of(const std::string& path, const load::LoadOptions& options = {}) {
  const Result<std::string> text = load::describe_part_text(path, options);
  EXPECT_TRUE(text.ok()) << text.error().message;
  return text ? *text : "";
}

nlohmann::json json_of(const std::string& path) {
  const Result<std::string> text = load::describe_part_json(path, {});
  EXPECT_TRUE(text.ok()) << text.error().message;
  return text ? nlohmann::json::parse(*text) : nlohmann::json();
}

TEST(Info, ACleanPartIsPlannedAsItIs) {
  const std::string text = text_of(corpus("nist_am_test_artifact_v3b.stl"));
  EXPECT_CONTAINS(text, "format               binary STL");
  EXPECT_CONTAINS(text, "triangles            7,392");
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

TEST(Info, TellsTheVolumeThatIsPlannedAndWhatHangsOnCaps) {
  EXPECT_CONTAINS(text_of(corpus("nist_am_test_artifact_v3b.stl")), "planned volume       100981 mm3\n");
  std::vector<FloatTriangle> open = unit_box();
  open.resize(10);  // without the face at x = 10, 600 of 2200 mm2
  const std::string path = write_file("open.stl", binary_stl(open));
  EXPECT_CONTAINS(text_of(path), "planned volume       6000 mm3, 27.3 % of the surface is caps");
  const nlohmann::json json = json_of(path);
  EXPECT_NEAR(json["planned_volume_mm3"].get<double>(), 6000, 1e-6);
  EXPECT_NEAR(json["capped_share"].get<double>(), 600.0 / 2200, 1e-9);
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
  const Result<std::string> text = load::describe_part_text(corpus("broken/plane_flat.stl"), {});
  ASSERT_FALSE(text.ok());
  EXPECT_EQ(text.error().fault, Fault::kInput);
  EXPECT_FALSE(load::describe_part_json(corpus("broken/empty_file.stl"), {}).ok());
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
