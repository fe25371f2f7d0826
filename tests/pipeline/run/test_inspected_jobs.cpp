// lamina jet --inspect on parts with planted faults: each is told with its number and place, sound parts are not.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

namespace lamina {
namespace {

namespace fs = std::filesystem;

/// A box between two corners, mm; `hollow` turns its facets inwards.
struct PlantedBox {
  std::array<double, 3> low, high;
  bool hollow = false;
};

class InspectedJobs : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("lamina-inspected-" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string stl(const std::string& name, const std::vector<PlantedBox>& boxes) const {
    constexpr int kFaces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                   {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    std::ofstream file(folder_ / name);
    file << "solid planted\n";
    for (const PlantedBox& box : boxes) {
      for (const auto& face : kFaces) {
        file << "facet normal 0 0 0\nouter loop\n";
        for (int k = 0; k < 3; ++k) {
          const int corner = face[box.hollow ? 2 - k : k];
          for (int axis = 0; axis < 3; ++axis) {
            file << (axis == 0 ? "vertex " : " ")
                 << ((corner >> axis & 1) != 0 ? box.high : box.low)[static_cast<std::size_t>(axis)];
          }
          file << "\n";
        }
        file << "endloop\nendfacet\n";
      }
    }
    file << "endsolid\n";
    return (folder_ / name).string();
  }

  nlohmann::json inspect(const std::string& arguments) const {
    const std::string command = std::string(LAMINA_PROGRAM) +
                                " jet --bed 40x40 --dpi 254 --layer 0.1 --inspect --json --quiet " + arguments + " -o " +
                                (folder_ / "out").string() + " --overwrite";
    std::string out;
    FILE* pipe = popen(command.c_str(), "r");
    char buffer[4096];
    for (std::size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) out.append(buffer, n);
    EXPECT_EQ(pclose(pipe), 0) << command;
    return nlohmann::json::parse(out);
  }
  static std::set<std::string> codes(const nlohmann::json& summary) {
    std::set<std::string> codes;
    for (const auto& warning : summary["warnings"]) codes.insert(warning["code"]);
    return codes;
  }

  fs::path folder_;
};

TEST_F(InspectedJobs, EachPlantedFaultIsToldAndSoundPartsAreNot) {
  const PlantedBox block{{0, 0, 0}, {10, 10, 5}};
  const struct {
    const char* name;
    std::vector<PlantedBox> boxes;
    std::set<std::string> told;
    const char* options = "";
  } cases[] = {
      {"a block", {block}, {}},
      {"a table: a plate on four feet",
       {{{0, 0, 0}, {1, 1, 3}},
        {{9, 0, 0}, {10, 1, 3}},
        {{0, 9, 0}, {1, 10, 3}},
        {{9, 9, 0}, {10, 10, 3}},
        {{0, 0, 2.9}, {10, 10, 4}}},
       {}},
      {"an island that joins: a hook",
       {{{0, 0, 0}, {2, 10, 5}}, {{0, 0, 4}, {10, 10, 5}}, {{8, 0, 2}, {10, 10, 4.05}}},
       {"islands"}},
      {"a body that falls off", {block, {{20, 0, 2}, {22, 2, 4}}}, {"islands", "loose"}},
      {"a closed hollow", {block, {{3, 3, 1}, {6, 6, 3}, true}}, {"hollows"}},
      {"a hollow open at the side", {block, {{-1, 3, 1}, {6, 6, 3}, true}}, {}, "--fill-rule positive"},
      {"a fin", {block, {{9, 4.9, 0}, {16, 5.2, 5}}}, {"thin"}, "--least-wall 0.5"},
      {"the same fin where that holds", {block, {{9, 4.9, 0}, {16, 5.2, 5}}}, {}, "--least-wall 0.25"},
      {"a block at the edge", {block}, {"bed-edge"}, "--at 0,15"},
  };
  for (const auto& [name, boxes, told, options] : cases) {
    EXPECT_EQ(codes(inspect(stl("part.stl", boxes) + " " + options)), told) << name;
    EXPECT_EQ(codes(inspect(stl("part.stl", boxes) + " --dry-run " + options)), told) << name;
  }
}

TEST_F(InspectedJobs, NumbersAndPlacesAreThoseOfThePlantedBoxes) {
  const auto summary = inspect(
      stl("part.stl",
          {{{0, 0, 0}, {10, 10, 5}}, {{2, 2, 1}, {4, 5, 3}, true}, {{6, 6, 2}, {7, 7, 3}, true}, {{12, 0, 2}, {13, 3, 2.5}}}) +
      " --at 0,0 --mirror x --core 0.5 --shell 0.3");
  const auto& found = summary["inspection"];
  EXPECT_EQ(found["layers"], 50);
  EXPECT_EQ(found["hollows"]["count"], 2);
  EXPECT_NEAR(found["hollows"]["mm3"], 12 + 1, 1e-6);
  EXPECT_NEAR(found["hollows"]["largest_mm3"], 12, 1e-6);
  EXPECT_EQ(found["hollows"]["largest_at"]["layer"], 10);
  EXPECT_NEAR(found["hollows"]["largest_at"]["x_mm"], 3, 0.11);
  EXPECT_NEAR(found["hollows"]["largest_at"]["y_mm"], 3.5, 0.11);
  EXPECT_EQ(found["loose"]["count"], 1);
  EXPECT_NEAR(found["loose"]["mm3"], 1.5, 1e-6);
  EXPECT_EQ(found["islands"]["count"], 1);
  EXPECT_NEAR(found["islands"]["mm2"], 3, 1e-6);
  EXPECT_EQ(found["bed_edge"]["layer"], 0);
}

TEST_F(InspectedJobs, PartsThatGrowTogetherAreNamed) {
  const std::string block = stl("block.stl", {{{0, 0, 0}, {10, 10, 5}}});
  EXPECT_EQ(codes(inspect(block + " --copies 2")), std::set<std::string>{});
  const auto job =
      [&](double x, double y, double z) {
        std::ofstream(folder_ / "two.toml")
            << "[[part]]\npath = \"block.stl\"\nat_mm = [5, 5]\n[[part]]\npath = \"block.stl\"\nat_mm = [" << x << ", " << y
            << "]\nbottom_mm = " << z << "\n";
        return inspect("--job " + (folder_ / "two.toml").string());
      };
  EXPECT_EQ(codes(job(15.2, 5, 0)), std::set<std::string>{});
  EXPECT_EQ(codes(job(15, 5, 0)), std::set<std::string>{"touching"});   // side by side
  EXPECT_EQ(codes(job(10, 10, 2)), std::set<std::string>{"touching"});  // within each other
  EXPECT_EQ(codes(job(5, 5, 5)), std::set<std::string>{"touching"});    // one upon the other
  EXPECT_EQ(codes(job(5, 5, 5.2)), std::set<std::string>{});            // powder between them
  const auto summary = job(5, 5, 5);
  EXPECT_EQ(summary["inspection"]["touching"].size(), 1u);
  EXPECT_EQ(summary["inspection"]["touching"][0]["at"]["layer"], 50);
}

}  // namespace
}  // namespace lamina
