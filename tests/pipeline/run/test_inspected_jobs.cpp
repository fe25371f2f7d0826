// lamina jet --inspect on parts with planted faults: each is reported with its number and position, sound parts are not.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
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
  /// A profile of nuferbj with more lines, which stand within [powder], or begin with [mounting] and stand there.
  std::string profile(const std::string& lines) const {
    std::ifstream shipped(fs::path(LAMINA_TEST_DIR).parent_path() / "pipeline/machine/shipped/printers/nuferbj.toml");
    std::string text{std::istreambuf_iterator<char>(shipped), std::istreambuf_iterator<char>()};
    const std::string mounting = "[mounting]\n";
    if (lines.starts_with(mounting)) {
      text.replace(text.find(mounting), mounting.size(), lines);
    } else {
      text += lines;
    }
    std::ofstream(folder_ / "machine.toml") << text;
    return (folder_ / "machine.toml").string();
  }
  /// Exit code, and the codes of warnings and what is said where it fails.
  struct Reported {
    int code = 0;
    std::set<std::string> warnings;
    std::string said;
  };
  Reported jet(const std::string& arguments) const {
    const fs::path said = folder_ / "said.txt";
    const std::string command = std::string(LAMINA_PROGRAM) + " jet --json --quiet " + arguments + " -o " +
                                (folder_ / "jet").string() + " --overwrite 2> " + said.string();
    std::string out;
    FILE* pipe = popen(command.c_str(), "r");
    char buffer[4096];
    for (std::size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) out.append(buffer, n);
    Reported reported{WEXITSTATUS(pclose(pipe)), {}, {}};
    std::ifstream file(said);
    reported.said.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    if (reported.code == 0) reported.warnings = codes(nlohmann::json::parse(out));
    return reported;
  }
  static std::set<std::string> codes(const nlohmann::json& summary) {
    std::set<std::string> codes;
    for (const auto& warning : summary["warnings"]) codes.insert(warning["code"]);
    return codes;
  }

  fs::path folder_;
};

TEST_F(InspectedJobs, EachPlantedFaultIsReportedAndSoundPartsAreNot) {
  const PlantedBox block{{0, 0, 0}, {10, 10, 5}};
  const struct {
    const char* name;
    std::vector<PlantedBox> boxes;
    std::set<std::string> reported;
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
      {"a fin", {block, {{9, 4.9, 0}, {16, 5.2, 5}}}, {"thin"}, "--min-wall 0.5"},
      {"the same fin where that holds", {block, {{9, 4.9, 0}, {16, 5.2, 5}}}, {}, "--min-wall 0.25"},
      {"a block at the edge", {block}, {"bed-edge"}, "--at 0,15"},
  };
  for (const auto& [name, boxes, reported, options] : cases) {
    EXPECT_EQ(codes(inspect(stl("part.stl", boxes) + " " + options)), reported) << name;
    EXPECT_EQ(codes(inspect(stl("part.stl", boxes) + " --dry-run " + options)), reported) << name;
  }
}

// Possible faults of powder, binder and head: each is refused with exit code 2 and a line, or done with a warning.
TEST_F(InspectedJobs, EachFaultOfPowderBinderAndHeadIsReportedOrRefused) {
  const std::string block = stl("block.stl", {{{0, 0, 0}, {10, 10, 2}}}), other = stl("other.stl", {{{0, 0, 0}, {10, 10, 2}}}),
                    fin = stl("fin.stl", {{{0, 0, 0}, {10, 1, 2}}}),
                    rib = stl("rib.stl", {{{0, 0, 0}, {10, 10, 2}}, {{12, 0, 0}, {12.5, 10, 1}}}),
                    plate = stl("plate.stl", {{{0, 0, 0}, {66, 66, 0.5}}}),
                    tall = stl("tall.stl", {{{0, 0, 0}, {10, 10, 200}}});
  std::string all = "0";
  for (int nozzle = 1; nozzle < 128; ++nozzle) all += "," + std::to_string(nozzle);
  const std::string maintenance = "[maintenance]\nspit_layers = 1\nspit_mm = [-40, 5]\n";
  const std::string two = block + " " + other + " --material steel,bronze";
  const struct {
    const char* name;
    std::string lines, arguments;
    int code;
    std::string reported;  // a warning's code, or what is said; empty: nothing
  } rows[] = {
      {"nothing wrong", "", block, 0, ""},
      {"two powders in a layer", "", two, 2, "mix powders"},
      {"the same, fed by the rule", "", two + " --vat-rule first", 0, "mixed-powders"},
      {"a vat that runs empty", "vat_depth_mm = [2.4, 0]\n", block, 2,
       "the first vat of nuferbj, 2.4 mm deep, is empty for it"},
      {"the same, filled in a pause", "vat_depth_mm = [2.4, 0]\nrefill = \"pause\"\n", block, 0, ""},
      {"a vat that just lasts", "vat_depth_mm = [2.5, 0]\n", block, 0, ""},
      {"a base that no vat holds", "vat_depth_mm = [3, 0]\nbase_layers = 30\n", block, 2, "holds less than this layer takes"},
      {"too little binder to bind", "min_saturation_percent = 50\n", block, 2, "or --allow-unbound"},
      {"the same, allowed", "min_saturation_percent = 50\n", block + " --allow-unbound", 0, "saturation"},
      {"more drops than a sweep and the profile allow", "", block + " --saturation 900", 0, "saturation"},
      {"a part that the bleed eats", "", fin + " --bleed 300", 0, "bleed"},
      {"a blocked nozzle", "", block + " --blocked 70", 0, "lost-pixels"},
      {"shots over the bed", "[maintenance]\nspit_layers = 1\nspit_mm = [65, 12]\n", block, 2, "nozzles are over the bed"},
      {"a wall that the bleed eats, of a part that it leaves", "", rib + " --bleed 300", 0, "vanished"},
      {"the same wall, and a bleed that leaves it", "", rib + " --bleed 150", 0, ""},
      {"edges that grow beyond the bed", "", plate + " --bleed -4000 --dry-run", 2, "outside of the bed"},
      {"shots without a place", "[maintenance]\nspit_layers = 1\n", block, 2, "maintenance.spit_mm: is missing"},
      {"a place to fire, and no shot", "[maintenance]\nspit_mm = [-40, 5]\n", block, 0, "maintenance"},
      {"wiping that never comes", "[maintenance]\nwipe_mm = [-40, 20, -40, 60]\n", block, 0, "maintenance"},
      {"a wiper without a way", "[maintenance]\nwipe_layers = 5\n", block, 2, "maintenance.wipe_mm: is missing"},
      {"a cap and no pause", maintenance + "cap_mm = [-40, 5]\n", block, 0, "maintenance"},
      {"a cap over the bed", "dry_s = 5\n[maintenance]\ncap_mm = [60, 20]\n", block, 2,
       "maintenance.cap_mm: nozzles are over the bed"},
      {"a lamp without a pause", "dry_on_lines = [\"M106 S255\"]\n", block, 2, "there is no pause to dry"},
      {"a lamp that stays on", "dry_s = 5\ndry_on_lines = [\"M106 S255\"]\n", block, 0, "maintenance"},
      {"the same, switched off", "dry_s = 5\ndry_on_lines = [\"M106 S255\"]\ndry_off_lines = [\"M107\"]\n", block, 0, ""},
      {"a pause longer than nozzles may wait", "dry_s = 90\n" + maintenance + "spit_seconds = 60\n", block, 0, "maintenance"},
      {"the same under a cap", "dry_s = 90\n" + maintenance + "spit_seconds = 60\ncap_mm = [-40, 5]\n", block, 0, ""},
      {"a pause to fill vats of no depth", "refill = \"pause\"\n", block, 2, "pauses need powder.vat_depth_mm"},
      {"joints that shift by a whole swath", "[mounting]\njoint_shift_lines = 128\n", block, 0, "stitching"},
      {"the same by less", "[mounting]\njoint_shift_lines = 48\n", block, 0, ""},
      {"a part higher than the machine builds", "", tall, 2, "above the build height"},
      {"nozzles that are faster than they fire", "", block + " --scan-speed 900", 2, "fires a nozzle"},
      {"a head all of whose nozzles are blocked", "", block + " --blocked " + all, 2, "one at least has to fire"},
      {"a powder that no vat holds", "materials = [\"steel\", \"bronze\"]\n", block + " --material zinc", 2, "zinc"},
      {"a clock that no sweep keeps", "[maintenance]\nspit_seconds = 0.5\nspit_mm = [-40, 5]\n", block, 2,
       "a sweep ends up to"},
  };
  for (const auto& [name, lines, arguments, code, reported] : rows) {
    const Reported found = jet("--machine " + profile(lines) + " --layer 0.1 " + arguments + (code == 0 ? " --dry-run" : ""));
    EXPECT_EQ(found.code, code) << name << found.said;
    if (code == 0) {
      EXPECT_EQ(found.warnings, reported.empty() ? std::set<std::string>() : std::set{reported}) << name;
    } else {
      EXPECT_NE(found.said.find(reported), std::string::npos) << name << ": " << found.said;
      EXPECT_FALSE(fs::exists(folder_ / "jet")) << name;
    }
  }
}

TEST_F(InspectedJobs, NumbersAndPositionsAreThoseOfThePlantedBoxes) {
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

// A wall of one pixel next to a block, by the requested width.
TEST_F(InspectedJobs, AWiderMinWallFindsAllThatANarrowerOneFinds) {
  const std::string part = stl("wall.stl", {{{0, 0, 0}, {10, 10, 1}}, {{10, 4, 0}, {16, 4.1, 1}}, {{3, 10, 0}, {3.4, 15, 1}}});
  std::uint64_t before = 0;
  for (const char* minimum : {"0.1", "0.15", "0.2", "0.3", "0.4", "0.5", "0.8", "1.5", "2", "4", "8"}) {
    const auto thin = inspect(part + " --dry-run --min-wall " + minimum)["inspection"]["thin"];
    const std::uint64_t count = thin["count"];
    EXPECT_GE(count, before) << minimum;
    before = count;
    const double width = std::stod(minimum);
    EXPECT_EQ(count, width <= 0.1 ? 0u : width <= 0.4 ? 1u : 2u) << minimum;
    EXPECT_EQ(count > 0 ? thin["locations"].size() : 0, count) << "each wall is one place";
  }
  // 0.3 mm are enough where nothing else is requested.
  EXPECT_EQ(codes(inspect(stl("three.stl", {{{0, 0, 0}, {10, 10, 1}}, {{10, 4, 0}, {16, 4.3, 1}}}))), std::set<std::string>{});
  EXPECT_EQ(codes(inspect(stl("two.stl", {{{0, 0, 0}, {10, 10, 1}}, {{10, 4, 0}, {16, 4.2, 1}}}))),
            std::set<std::string>{"thin"});
  EXPECT_EQ(codes(inspect(part)), std::set<std::string>{"thin"});
}

// Layers of random bits as a part: bodies without number, reported as not inspected, and the job is done all the same.
TEST_F(InspectedJobs, WhatTakesMoreMemoryThanItMayIsReportedAndTheJobContinues) {
  fs::create_directories(folder_ / "noise");
  std::uint32_t state = 12345;
  for (const int layer : {0, 1, 2, 3}) {
    std::string bits(std::size_t{400} * 50, '\0');
    for (char& byte : bits) byte = layer == 0 ? '\x7f' : static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
    std::ofstream(folder_ / "noise" / (std::to_string(layer) + ".pbm"), std::ios::binary) << "P4\n400 400\n" << bits;
  }
  std::ofstream(folder_ / "noise.toml") << "[[part]]\npath = \"noise\"\ndpi = 254\nlayer_mm = 0.1\nat_mm = [0, 0]\n";
  const std::string job = "--job " + (folder_ / "noise.toml").string();
  const auto whole = inspect(job);
  EXPECT_EQ(whole["inspection"]["layers"], 4);
  EXPECT_FALSE(whole["inspection"].contains("stopped"));
  const auto tight = inspect(job + " --memory 16M");
  EXPECT_EQ(tight["layers_planned"], 4);
  EXPECT_EQ(tight["set_pixels"], whole["set_pixels"]);
  EXPECT_EQ(tight["inspection"]["layers"], 1);
  EXPECT_EQ(tight["inspection"]["stopped"]["layer"], 1);
  EXPECT_TRUE(codes(tight).contains("not-inspected"));
  EXPECT_LT(tight["peak_layer_bytes"], whole["peak_layer_bytes"]);
  // The memory that it requests is enough.
  const std::string text = tight["warnings"].back()["text"], give = "give --memory ";
  const std::string requested =
      text.substr(text.find(give) + give.size(), text.find(" or more") - text.find(give) - give.size());
  EXPECT_GT(inspect(job + " --memory " + requested)["inspection"]["layers"].get<int>(), 1) << text;
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
  EXPECT_EQ(codes(job(15.5, 5, 0)), std::set<std::string>{});
  EXPECT_EQ(codes(job(15, 5, 0)), std::set<std::string>{"touching"});   // side by side
  EXPECT_EQ(codes(job(10, 10, 2)), std::set<std::string>{"touching"});  // within each other
  EXPECT_EQ(codes(job(5, 5, 5)), std::set<std::string>{"touching"});    // one upon the other
  EXPECT_EQ(codes(job(5, 5, 5.5)), std::set<std::string>{});            // powder between them
  EXPECT_EQ(codes(job(15.2, 5, 0)), std::set<std::string>{"gaps"});     // less than the default minimum of 0.3 mm
  EXPECT_EQ(codes(job(5, 5, 5.2)), std::set<std::string>{"gaps"});
  const auto neighbour = job(15, 8, 0)["inspection"]["touching"][0]["at"];
  EXPECT_NEAR(neighbour["x_mm"].get<double>(), 15, 0.2) << neighbour.dump();
  EXPECT_NEAR(neighbour["y_mm"].get<double>(), 11.5, 0.2) << "from 8 to 15";
  const auto summary = job(5, 5, 5);
  EXPECT_EQ(summary["inspection"]["touching"].size(), 1u);
  EXPECT_EQ(summary["inspection"]["touching"][0]["at"]["layer"], 50);
}

}  // namespace
}  // namespace lamina
