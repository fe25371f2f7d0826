// What lamina jet --inspect found is kept next to the manifest and shown by lamina report, with its positions.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

class InspectedReports : public ::testing::Test {
 protected:
  Outcome lamina(const Words& arguments) { return run_lamina(arguments, directory_.path()); }

  /// A plate of 20 x 20 x 3 mm at 10, 10 on a bed of 40 x 60, with a closed hollow of 4 x 2 x 1 mm at 13, 25, 1, and a peg of
  /// 2 x 3 x 1 mm that hangs at 34, 12, 1.
  void planted() {
    write_text(directory_ / "hollow.obj", boxes({{10, 10, 0, 30, 30, 3}, {34, 12, 1, 36, 15, 2}}, {{13, 25, 1, 17, 27, 2}}));
  }
  /// A closed hollow, a slit of less than half a pixel, which samples between pixels find, and a peg that hangs.
  void slit() {
    write_text(directory_ / "hollow.obj",
               boxes({{10, 10, 0, 20, 20, 3}, {20.04, 10, 0, 30, 20, 3}, {34, 12, 1, 36, 15, 2}}, {{13, 13, 1, 17, 16, 2}}));
  }
  static std::string boxes(const std::vector<std::array<double, 6>>& solid, const std::vector<std::array<double, 6>>& hollow) {
    std::string text;
    int vertices = 0;
    const auto add = [&](const std::array<double, 6>& box, bool inwards) {
      for (int corner = 0; corner < 8; ++corner) {
        text += "v";
        for (int axis = 0; axis < 3; ++axis) {
          text += " " + std::to_string(box[static_cast<std::size_t>(axis + ((corner >> axis & 1) != 0 ? 3 : 0))]);
        }
        text += "\n";
      }
      for (auto face : std::vector<std::array<int, 4>>{
               {1, 3, 4, 2}, {5, 6, 8, 7}, {1, 2, 6, 5}, {3, 7, 8, 4}, {1, 5, 7, 3}, {2, 4, 8, 6}}) {
        if (inwards) std::reverse(face.begin(), face.end());
        text += "f";
        for (const int corner : face) text += " " + std::to_string(vertices + corner);
        text += "\n";
      }
      vertices += 8;
    };
    for (const auto& box : solid) add(box, false);
    for (const auto& box : hollow) add(box, true);
    return text;
  }
  Words job(const Words& more) {
    Words words = {"jet", "hollow.obj", "--bed", "40x60",   "--at", "10,10", "--dpi",
                   "254", "--layer",    "0.1",   "--quiet", "-o",   "out"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  Json head() {
    const Outcome outcome = lamina({"report", "out", "-o", "report.html", "--quiet", "--overwrite"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    const std::string page = read_text(directory_ / "report.html");
    const std::string begin = "<script id=\"head\" type=\"application/json\">";
    const std::size_t at = page.find(begin) + begin.size();
    return Json::parse(page.substr(at, page.find("</script>", at) - at));
  }
  static std::vector<std::string> codes(const Json& list) {
    std::vector<std::string> codes;
    for (const Json& one : list) codes.push_back(one["code"]);
    return codes;
  }

  Directory directory_;
};

TEST_F(InspectedReports, PositionsAreThoseOfThePlantedBoxes) {
  planted();
  for (const char* mirror : {"none", "x", "xy"}) {
    ASSERT_EQ(lamina(job({"--inspect", "--mirror", mirror, "--overwrite"})).code, 0);
    const Json page = head();
    const auto warned = codes(page["warnings"]);
    for (const char* code : {"islands", "loose", "hollows"}) {
      EXPECT_NE(std::find(warned.begin(), warned.end(), code), warned.end()) << code;
    }
    ASSERT_EQ(codes(page["locations"]), (std::vector<std::string>{"islands", "loose", "hollows"}));
    const bool x = std::string(mirror) != "none", y = std::string(mirror) == "xy";
    const double middle[3][5] = {{35, 13.5, 1, 10, 10}, {35, 13.5, 1, 10, 19}, {15, 26, 1, 10, 19}};  // x, y, z, layers
    const double size[3][3] = {{2, 3, 6}, {2, 3, 6}, {4, 2, 8}};                                      // and mm2 or mm3
    for (std::size_t i = 0; i < 3; ++i) {
      SCOPED_TRACE(std::string(mirror) + " " + std::to_string(i));
      const Json& position = page["locations"][i];
      for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(position["mm"][k].get<double>(), middle[i][k], 0.101);
      EXPECT_EQ(position["layers"], (Json{middle[i][3], middle[i][4]}));
      EXPECT_NEAR(position["box_mm"][0].get<double>(), x ? 40 - middle[i][0] : middle[i][0], 0.101);
      EXPECT_NEAR(position["box_mm"][1].get<double>(), y ? middle[i][1] : 60 - middle[i][1], 0.101);
      EXPECT_NEAR(position["box_mm"][2].get<double>(), size[i][0], 0.101);
      EXPECT_NEAR(position["box_mm"][3].get<double>(), size[i][1], 0.101);
      EXPECT_NEAR(position["amount"].get<double>(), size[i][2], 0.05);
    }
  }
}

TEST_F(InspectedReports, TheManifestIsTheSameAndTheFileIsThatOfItsJob) {
  planted();
  ASSERT_EQ(lamina(job({"--inspect"})).code, 0);
  const std::string manifest = read_text(directory_ / "out/manifest.json"),
                    found = read_text(directory_ / "out/inspection.json");
  EXPECT_EQ(lamina({"verify", "out"}).code, 0);
  ASSERT_EQ(lamina(job({"--resume"})).code, 0);
  EXPECT_EQ(read_text(directory_ / "out/inspection.json"), found) << "the same job";
  ASSERT_EQ(lamina(job({"--overwrite"})).code, 0);
  EXPECT_EQ(read_text(directory_ / "out/manifest.json"), manifest);
  EXPECT_EQ(read_text(directory_ / "out/inspection.json"), found) << "its layers are the same, inspected or not";
  EXPECT_FALSE(head()["locations"].empty());
  ASSERT_EQ(lamina(job({"--overwrite", "--layer", "0.2"})).code, 0);
  EXPECT_FALSE(fs::exists(directory_ / "out/inspection.json")) << "another job";
  EXPECT_TRUE(head()["locations"].empty());
  // A file of another job, or no file of lamina's form, reports nothing or is reported.
  write_text(directory_ / "out/inspection.json", found);
  EXPECT_TRUE(head()["locations"].empty());
  ASSERT_EQ(lamina(job({"--overwrite", "--inspect"})).code, 0);
  std::string other = read_text(directory_ / "out/inspection.json");
  other.replace(other.find("\"islands\""), 9, "\"Islands\"");
  write_text(directory_ / "out/inspection.json", other);
  EXPECT_EQ(codes(head()["warnings"]).back(), "inspection");
  // Layers that the job has not.
  for (const char* beyond : {"4711", "-1"}) {
    other = std::regex_replace(found, std::regex("\"layer\":[0-9]+"), std::string("\"layer\":") + beyond);
    ASSERT_EQ(lamina(job({"--overwrite", "--inspect"})).code, 0);
    write_text(directory_ / "out/inspection.json", other);
    EXPECT_EQ(codes(head()["warnings"]).back(), "inspection") << beyond;
    EXPECT_TRUE(head()["locations"].empty());
  }
  for (const char* text : {"", "{", "{\"kind\":\"inspection\"}", "[1]"}) {
    write_text(directory_ / "out/inspection.json", text);
    EXPECT_TRUE(head()["locations"].empty()) << text;
  }
  write_text(directory_ / "out/inspection.json", "notes of mine");
  const Outcome refused = lamina(job({"--overwrite", "--inspect"}));
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("out/inspection.json: is there already, and lamina did not write it"), std::string::npos)
      << refused.err;
  EXPECT_EQ(read_text(directory_ / "out/inspection.json"), "notes of mine");
  ASSERT_EQ(lamina(job({"--overwrite"})).code, 0);
  EXPECT_EQ(read_text(directory_ / "out/inspection.json"), "notes of mine");
}

// The hollow of 13 to 17 and 25 to 27 mm: 130 to 170 and, from the back, 330 to 350 pixels, with a frame around it.
TEST_F(InspectedReports, InABrowserAButtonLeadsToTheFrameOfAPosition) {
  planted();
  ASSERT_EQ(lamina(job({"--inspect"})).code, 0);
  ASSERT_EQ(lamina({"report", "out", "-o", "report.html", "--quiet"}).code, 0);
  const auto [status, text] = in_browser(directory_ / "report.html", 0);
  if (status == kNoBrowser) GTEST_SKIP() << "NOT RUN: places in a browser; install Debian's chromium";
  ASSERT_EQ(status, 0);
  const Json said = Json::parse(text);
  EXPECT_EQ(said["console"], Json::array());
  ASSERT_EQ(said["locations"].size(), 3u);
  EXPECT_EQ(said["locations"][2], "hollows of 8 mm³ at x 14.95, y 26.05, z 1 mm, layer 10 to 19");
  EXPECT_EQ(said["steps"]["position"]["layer"], 10);
  EXPECT_NEAR(said["steps"]["position"]["x"].get<double>(), 150, 1);
  EXPECT_NEAR(said["steps"]["position"]["y"].get<double>(), 340, 1);
  const Json& frame = said["frames"][2];
  const double minimum[] = {120, 320, 170, 350}, maximum[] = {130, 330, 180, 360};
  for (std::size_t side = 0; side < 4; ++side) {
    EXPECT_GE(frame[side].get<double>(), minimum[side]) << side;
    EXPECT_LE(frame[side].get<double>(), maximum[side]) << side;
  }
}

// A thin wall is thin in all its layers, and one place.
TEST_F(InspectedReports, AThinWallIsOnePosition) {
  write_text(directory_ / "hollow.obj", boxes({{10, 10, 0, 20, 20, 3}, {19, 14, 0, 30, 14.4, 2}}, {}));
  ASSERT_EQ(lamina(job({"--inspect", "--min-wall", "0.8"})).code, 0);
  const Json locations = head()["locations"];
  ASSERT_EQ(locations.size(), 1u) << locations.dump();
  EXPECT_EQ(locations[0]["code"], "thin");
  EXPECT_EQ(locations[0]["layers"], (Json{0, 19}));
  EXPECT_NEAR(locations[0]["mm"][0].get<double>(), 25, 0.5);
}

/// Jobs whose images lack what their inspection needs: bleed and mirrors, levels, no files at all.
const Words kMore[] = {{}, {"--mirror", "xy", "--bleed", "150"}, {"--levels", "4"}, {"--format", "null"}, {"--threads", "1"}};

TEST_F(InspectedReports, OfAResumedRunIsThatOfAnUninterruptedOne) {
  slit();
  for (const Words& more : kMore) {
    Words words = job(more);
    words.insert(words.end(), {"--inspect", "--overwrite"});
    ASSERT_EQ(lamina(words).code, 0);
    const std::string whole = tree_text(directory_ / "out"), manifest = read_text(directory_ / "out/manifest.json");
    ASSERT_NE(whole.find("\"hollows\":{\"count\":1"), std::string::npos);
    ASSERT_EQ(whole.find("\"gaps\":{\"count\":0") == std::string::npos, more.empty() || more[0] != "--levels");
    words.back() = "--resume";
    for (const int kept : {30, 29, 12, 1, 0}) {
      fs::remove(directory_ / "out/inspection.json");
      if (kept < 30) {
        std::size_t end = manifest.find("\"layers\": [") + 11;
        for (int i = 0; i < kept; ++i) end = manifest.find('\n', end + 1);
        write_text(directory_ / "out/manifest.json.part", manifest.substr(0, end));
        fs::remove(directory_ / "out/manifest.json");
      }
      words.push_back("--json");
      const Outcome outcome = lamina(words);
      words.pop_back();
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      EXPECT_EQ(Json::parse(outcome.out)["layers_kept"], kept);
      EXPECT_EQ(Json::parse(outcome.out)["layers_planned"], 30 - kept);
      EXPECT_TRUE(tree_text(directory_ / "out") == whole) << kept << " kept, " << (more.empty() ? "" : more[0]);
    }
  }
}

TEST_F(InspectedReports, OfMergedShardsAndRangesIsThatOfAWholeRun) {
  slit();
  for (const Words& more : kMore) {
    Words words = job(more);
    words.insert(words.end(), {"--inspect", "--overwrite"});
    ASSERT_EQ(lamina(words).code, 0);
    const std::string whole = tree_text(directory_ / "out");
    const auto part = [&](const std::string& flag, const std::string& value, const std::string& output) {
      Words one = words;
      *(std::find(one.begin(), one.end(), "-o") + 1) = output;
      one.insert(one.end(), {flag, value, "--json"});
      const Outcome outcome = lamina(one);
      EXPECT_EQ(outcome.code, 0) << outcome.err;
      EXPECT_EQ(Json::parse(outcome.out)["inspection"]["layers"], 0) << "not yet";
      EXPECT_FALSE(fs::exists(directory_ / (output + "/inspection.json")));
    };
    for (const char* shard : {"3/3", "1/3", "2/3"}) part("--shard", shard, "shards");
    for (const char* shard : {"1/2", "2/2"}) part("--shard", shard, std::string("s") + shard[0]);
    part("--layers", "0:13", "low");
    part("--layers", "13:30", "high");
    for (const Words& merge : {Words{"merge", "shards", "-o", "shards"}, Words{"merge", "s2", "s1", "-o", "joined"},
                               Words{"merge", "low", "high", "-o", "ranges"}, Words{"merge", "low", "high", "-o", "low"}}) {
      const Outcome outcome = lamina(merge);
      EXPECT_EQ(outcome.code, 0) << outcome.err;
      EXPECT_NE(outcome.err.find("one closed hollow"), std::string::npos) << outcome.err;
      EXPECT_TRUE(tree_text(directory_ / merge.back()) == whole) << merge.back() << (more.empty() ? "" : more[0]);
    }
    for (const char* done : {"shards", "s1", "s2", "joined", "ranges", "low", "high"}) fs::remove_all(directory_ / done);
  }
}

TEST_F(InspectedReports, ThatCannotBeMadeAreReportedByTheMerge) {
  slit();
  ASSERT_EQ(lamina(job({"--inspect"})).code, 0);
  const std::string whole = tree_text(directory_ / "out");
  const auto shard = [&](const char* number, Words more) {
    more.insert(more.end(), {"--shard", std::string(number) + "/2", "-o", std::string("s") + number});
    Words words = job(more);
    words.erase(std::find(words.begin(), words.end(), "-o"), std::find(words.begin(), words.end(), "-o") + 2);
    EXPECT_EQ(lamina(words).code, 0);
  };
  const auto merged = [&](const Words& more) {
    Words words{"merge", "s1", "s2", "-o", "m"};
    words.insert(words.end(), more.begin(), more.end());
    return lamina(words);
  };
  const auto not_inspected = [&](const std::string& why) {
    const Outcome strict = merged({"--strict"});
    EXPECT_EQ(strict.code, 5) << why;
    EXPECT_FALSE(fs::exists(directory_ / "m")) << why;
    const Outcome outcome = merged({});
    EXPECT_EQ(outcome.code, 0);
    EXPECT_NE(outcome.err.find("the layers were not inspected: s2/inspection-2-of-2.zst: " + why), std::string::npos)
        << outcome.err;
    EXPECT_FALSE(fs::exists(directory_ / "m/inspection.json"));
    fs::remove_all(directory_ / "m");
  };
  shard("1", {"--inspect"});
  shard("2", {});
  not_inspected("No such file");
  shard("2", {"--resume", "--inspect", "--min-wall", "1"});
  not_inspected("--min-wall differs");
  shard("2", {"--resume", "--inspect"});
  const std::string sections = read_text(directory_ / "s2/inspection-2-of-2.zst");
  for (std::size_t at = 20; at < sections.size(); at += sections.size() / 7) {
    std::string torn = sections;
    torn[at] = static_cast<char>(torn[at] ^ 4);
    write_text(directory_ / "s2/inspection-2-of-2.zst", torn);
    not_inspected("");
  }
  write_text(directory_ / "s2/inspection-2-of-2.zst", sections.substr(0, sections.size() / 2));
  not_inspected("");
  write_text(directory_ / "s2/inspection-2-of-2.zst", sections);
  EXPECT_EQ(merged({}).code, 0);
  EXPECT_TRUE(tree_text(directory_ / "m") == whole);
  // A merge into a shard's own directory would remove what the remedy needs.
  fs::remove(directory_ / "s2/inspection-2-of-2.zst");
  const std::string before = tree_text(directory_ / "s1") + tree_text(directory_ / "s2");
  const Outcome refused = lamina({"merge", "s1", "s2", "-o", "s1"});
  EXPECT_EQ(refused.code, 5);
  EXPECT_NE(refused.err.find("; without inspection, merge into another directory"), std::string::npos) << refused.err;
  EXPECT_EQ(tree_text(directory_ / "s1") + tree_text(directory_ / "s2"), before);
  shard("2", {"--resume", "--inspect"});
  EXPECT_EQ(lamina({"merge", "s1", "s2", "-o", "s1"}).code, 0);
  EXPECT_TRUE(tree_text(directory_ / "s1") == whole);
}

}  // namespace
}  // namespace lamina::test
