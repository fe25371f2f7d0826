// tests/pipeline/pores/test_image_stack.cpp: folders of images as pores, and scans compared with their plans.
#include <gtest/gtest.h>
#include <png.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "pipeline/pores/bead_voxels.h"
#include "stages/segment/permeability.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

std::string numbered(const std::string& folder, int number, const char* ending) {
  return folder + "/slice" + std::string(number < 10 ? "00" : number < 100 ? "0" : "") + std::to_string(number) + ending;
}

/// Black where a function of column and row, from above, is true.
void write_pbm(const std::string& path, std::uint32_t columns, std::uint32_t rows, const auto& black) {
  std::string bytes = "P4\n" + std::to_string(columns) + " " + std::to_string(rows) + "\n";
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t first = 0; first < columns; first += 8) {
      unsigned byte = 0;
      for (std::uint32_t i = 0; i < 8 && first + i < columns; ++i) byte |= (black(first + i, r) ? 128u : 0u) >> i;
      bytes += static_cast<char>(byte);
    }
  }
  test::write_text(path, bytes);
}

void write_grey(const std::string& path, std::uint32_t columns, std::uint32_t rows, const auto& value) {
  std::vector<png_byte> pixels;
  for (std::uint32_t r = 0; r < rows; ++r)
    for (std::uint32_t c = 0; c < columns; ++c) pixels.push_back(static_cast<png_byte>(value(c, r)));
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = columns;
  image.height = rows;
  image.format = PNG_FORMAT_GRAY;
  ASSERT_NE(png_image_write_to_file(&image, path.c_str(), 0, pixels.data(), 0, nullptr), 0);
}

class ImageStack : public testing::Test {
 protected:
  test::Outcome run(const std::string& line) { return test::run_lamina(test::words_of("permeability " + line), folder.path()); }
  nlohmann::json reported(const std::string& line) {
    const test::Outcome outcome = run(line + " --json");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.code == 0 ? nlohmann::json::parse(outcome.out) : nlohmann::json();
  }
  test::Directory folder;
};

/// A slit of 12 voxels in a period of 16: k1 along it is porosity x width^2 / 12.
TEST_F(ImageStack, OfASlitHasItsPermeabilityFromGreyAndFromBlackAndWhite) {
  fs::create_directory(folder / "grey");
  fs::create_directory(folder / "bits");
  const auto open = [](std::uint32_t column) { return column >= 2 && column < 14; };
  for (int z = 0; z < 4; ++z) {
    write_grey(numbered(folder / "grey", z + 7, ".png"), 16, 4, [&](auto c, auto) { return open(c) ? 99 : 100; });
    write_pbm(numbered(folder / "bits", z + 7, ".pbm"), 16, 4, [&](auto c, auto) { return open(c); });
  }
  const double wanted = 0.75 * 120e-6 * 120e-6 / 12;
  for (const char* call : {"grey --pixel 10 --threshold 100 --periodic xyz", "bits --pixel 10 --periodic xyz"}) {
    const nlohmann::json json = reported(call);
    ASSERT_TRUE(json.contains("flow")) << call;
    EXPECT_EQ(json["porosity"].get<double>(), 0.75) << call;
    for (const std::size_t along : {1, 2})
      EXPECT_NEAR(json["flow"][along]["k1_column_darcy"][along].get<double>() * segment::kDarcy / wanted, 1, 0.03) << call;
    EXPECT_EQ(json["flow"][0]["k1_darcy"].get<double>(), 0) << call;
  }
  EXPECT_EQ(reported("bits --pixel 10 --dark --no-flow")["porosity"].get<double>(), 0.25);
  EXPECT_EQ(reported("grey --pixel 10 --threshold 99 --no-flow")["porosity"].get<double>(), 0);
  EXPECT_EQ(reported("bits --pixel 10 --voxel 20 --no-flow")["voxels"], (nlohmann::json{8, 2, 2}));
  EXPECT_EQ(reported("bits --pixel 20 --layer-um 60 --window 0.16,0.08,0.18 --no-flow")["voxels"], (nlohmann::json{8, 4, 2}));
}

TEST_F(ImageStack, OfAJobKnowsItsPixelsAndLayers) {
  test::write_box(folder / "part.stl", {0, 0, 0}, {6, 4, 3});
  ASSERT_EQ(
      test::run_lamina(test::words_of("jet part.stl --layer 0.25 --dpi 254 --bed 20x20 --quiet -o job"), folder.path()).code,
      0);
  const nlohmann::json inside = reported("job --window 2,1,1 --no-flow"), all = reported("job --window 6,4,3 --no-flow");
  EXPECT_EQ(inside["voxels"], (nlohmann::json{20, 10, 4}));
  EXPECT_EQ(inside["porosity"].get<double>(), 0);
  EXPECT_EQ(all["voxels"], (nlohmann::json{60, 40, 12}));
  EXPECT_EQ(all["porosity"].get<double>(), 0) << "the part and nothing else";
}

// Drops of a pixel are no shares of a voxel: one of 20 is part of the solid, of every material.
TEST_F(ImageStack, OfAJobOfSeveralDropsIsSolidWhereAnyFalls) {
  test::write_text(
      folder / "two.toml",
      "[machine]\nname = \"two\"\ndialect = \"raw\"\n[bed]\nsize_mm = [20, 20]\n[head]\nnozzles = 64\n"
      "pitch_um = 100\ndrop_pl = 100\n[powder]\nvats = 2\nmaterials = [\"b\", \"a\"]\nvat_rule = \"both\"\npacking = 0.5\n");
  test::write_box(folder / "part.stl", {0, 0, 0}, {3, 4, 3});
  for (const std::string format : {"tiff-g4", "tiff-4", "tiff-8"}) {
    test::write_text(folder / "job.toml",
                     "[machine]\nprofile = \"two.toml\"\n[layers]\nthickness_mm = 0.25\n[dose]\n"
                     "saturation_percent = 40\n[[part]]\npath = \"part.stl\"\nat_mm = [5, 5]\n"
                     "material = \"a\"\n[[part]]\npath = \"part.stl\"\nat_mm = [8, 5]\nmaterial = \"b\"\n");
    const test::Outcome made =
        test::run_lamina(test::words_of("jet --job job.toml --quiet --format " + format + " -o " + format), folder.path());
    ASSERT_EQ(made.code, 0) << made.err;
    EXPECT_EQ(reported(format + " --window 2,2,2 --no-flow")["porosity"].get<double>(), 0) << format;
  }
}

TEST_F(ImageStack, WithFaultsIsOneLine) {
  fs::create_directory(folder / "s");
  const auto solid = [](auto, auto) { return false; };
  for (int z = 1; z <= 6; ++z) write_pbm(numbered(folder / "s", z, ".pbm"), 16, 16, solid);
  const auto refused = [&](const std::string& call, int code, const std::string& words) {
    const test::Outcome outcome = run(call);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
  };
  refused("s", 2, "give --pixel");
  refused("s --pixel 10 --window 1,0.1,0.05", 2, "1.000 mm along x are more than the images have: 0.160 mm");
  refused("s --pixel 10 --periodic xa", 2, "is not of the axes");
  refused("s --pixel 10 --length 5", 3, "--length is for tables");
  refused("s --pixel 10 --scan s", 2, "--scan is for toolpaths");
  write_pbm(numbered(folder / "s", 3, ".pbm"), 16, 12, solid);
  refused("s --pixel 10", 3, "layer 2 is 16 x 12 pixels, others are 16 x 16");
  test::write_text(numbered(folder / "s", 3, ".pbm"), "P4\n16 16\nx");
  refused("s --pixel 10", 3, "slice003.pbm: not a whole PBM");
  fs::remove(numbered(folder / "s", 3, ".pbm"));
  refused("s --pixel 10", 3, "slice004.pbm: number 3 is missing before it");
  write_pbm(numbered(folder / "s", 3, ".tif"), 16, 16, solid);
  write_pbm(folder / "s/other0003.pbm", 16, 16, solid);
  refused("s --pixel 10", 3, "has the number of");
  test::write_text(folder / "s/other0003.pbm", "");
  fs::rename(folder / "s/other0003.pbm", folder / "s/cover.pbm");
  refused("s --pixel 10", 3, "cover.pbm: has no layer number");
  fs::create_directory(folder / "none");
  refused("none --pixel 10", 3, "contains neither");
  fs::create_directory(folder / "white");
  for (int z = 1; z <= 6; ++z) write_pbm(numbered(folder / "white", z, ".pbm"), 16, 16, [](auto, auto) { return true; });
  refused("white --pixel 10 --periodic xyz", 3, "nothing is solid in the window");
  refused("white --pixel 10 --threshold 110.5", 2, "--threshold: '110.5'");
}

/// A slit along y between two solid layers.
TEST_F(ImageStack, IsPicturedAlongTheAxisThatLetsThrough) {
  fs::create_directory(folder / "s");
  for (int z = 1; z <= 12; ++z) {
    write_pbm(numbered(folder / "s", z, ".pbm"), 16, 8,
              [&](auto column, auto) { return z > 2 && z < 11 && column > 2 && column < 13; });
  }
  EXPECT_EQ(run("s --pixel 10 --plot pores.svg").code, 0);
  const std::string picture = test::read_text(folder / "pores.svg");
  EXPECT_NE(picture.find(" D along y ("), std::string::npos);
  EXPECT_NE(picture.find("(a) velocity along y where it is fastest, y = "), std::string::npos);
  EXPECT_NE(picture.find("z upwards"), std::string::npos);
  for (int z = 1; z <= 12; ++z)
    write_pbm(numbered(folder / "s", z, ".pbm"), 16, 8,
              [&](auto column, auto row) { return column == 5 && row == 3 && z == 6; });
  EXPECT_EQ(run("s --pixel 10 --plot pores.svg").code, 0);
  EXPECT_NE(test::read_text(folder / "pores.svg").find("s: no connected void"), std::string::npos);
}

/// Another program's manifest.json says nothing about the images next to it.
TEST_F(ImageStack, NextToAnUnrelatedManifestIsAStackOfImages) {
  fs::create_directory(folder / "web");
  for (int z = 1; z <= 6; ++z)
    write_pbm(numbered(folder / "web", z, ".pbm"), 16, 16, [](auto column, auto) { return column < 4; });
  for (const char* manifest :
       {"{\"name\": \"gallery\", \"icons\": []}\n", "{\n  \"short_name\": \"x\"\n}\n", "", "[]", "\xff\xfe"}) {
    test::write_text(folder / "web/manifest.json", manifest);
    EXPECT_EQ(reported("web --pixel 10 --no-flow")["porosity"].get<double>(), 0.25) << manifest;
  }
  test::write_text(folder / "web/manifest.json", "{\n\"lamina\": \"0.1.0\",\n");
  EXPECT_EQ(run("web --no-flow").code, 3) << "one of lamina that is cut off";
}

/// No option contradicts what the manifest states.
TEST_F(ImageStack, OfAJobRefusesWhatItsManifestStates) {
  test::write_box(folder / "part.stl", {0, 0, 0}, {6, 4, 3});
  ASSERT_EQ(
      test::run_lamina(test::words_of("jet part.stl --layer 0.25 --dpi 254 --bed 20x20 --quiet -o job"), folder.path()).code,
      0);
  for (const std::string option : {"--pixel 50", "--layer-um 100", "--threshold 99", "--dark"}) {
    const test::Outcome outcome = run("job --no-flow " + option);
    EXPECT_EQ(outcome.code, 2) << option;
    EXPECT_NE(outcome.err.find(option.substr(0, option.find(' ')) + " is for images without a manifest"), std::string::npos)
        << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
  }
}

/// A refusal of the flow comes after the window is cut: no requested output remains, and earlier files stay.
TEST_F(ImageStack, RefusedLeavesNoFileOfTheWindow) {
  fs::create_directory(folder / "s");
  for (int z = 1; z <= 32; ++z)
    write_pbm(numbered(folder / "s", z, ".pbm"), 32, 32, [](auto column, auto) { return column < 28; });
  const std::string call = "s --pixel 10 --solid a.nrrd --void b.stl --plot c.svg";
  test::Outcome outcome = run(call + " --memory 1M");
  EXPECT_EQ(outcome.code, 2) << outcome.err;
  EXPECT_NE(outcome.err.find("--memory allows"), std::string::npos) << outcome.err;
  for (const char* name : {"a.nrrd", "b.stl", "c.svg"}) EXPECT_FALSE(fs::exists(folder / name)) << name;
  EXPECT_EQ(run(call + " --no-flow").code, 0);
  const std::string before = test::read_text(folder / "a.nrrd");
  fs::remove(folder / "c.svg");
  fs::create_directory(folder / "c.svg");
  outcome = run(call + " --no-flow --window 0.1,0.1,0.1");
  EXPECT_NE(outcome.code, 0);
  EXPECT_TRUE(test::read_text(folder / "a.nrrd") == before) << "the picture cannot be written, and so nothing is";
}

/// Lines that cross, as in test_predicted_flow.cpp.
void write_lines(const std::string& path) {
  std::ofstream file(path);
  file << "G21\nG90\nM83\n";
  for (int layer = 1; layer <= 5; ++layer) {
    file << ";LAYER_CHANGE\n;Z:" << 0.3 * layer << "\n;HEIGHT:0.3\nG1 Z" << 0.3 * layer << " F600\n;WIDTH:0.5\n";
    for (int line = 0; line < 20; ++line) {
      const double at = 10 + 0.8 * line;
      if (layer % 2 == 0)
        file << "G0 X10 Y" << at << "\nG1 X25.2 Y" << at << " E1 F900\n";
      else
        file << "G0 X" << at << " Y10\nG1 X" << at << " Y25.2 E1 F900\n";
    }
  }
}

TEST_F(ImageStack, OfAPlanThatIsShiftedAndGrownByAVoxelComesBackWithBoth) {
  write_lines(folder / "lines.gcode");
  const Result<formats::GcodeFile> file = formats::GcodeFile::open(folder / "lines.gcode");
  ASSERT_TRUE(file.ok());
  const Result<pipeline::Pile> pile = pipeline::pile_of(*file);
  ASSERT_TRUE(pile.ok());
  constexpr std::int64_t kEdge = 25'000, kSide = 100, kHigh = 60;
  const std::array<std::int64_t, 3> shift{3, -2, 1};
  const Point3 middle = file->box().middle();
  const std::array<std::int64_t, 3> low{middle.x - kSide / 2 * kEdge, middle.y - kSide / 2 * kEdge, 0};
  pipeline::Window window;
  window.count = {kSide, kSide, kHigh};
  const auto corner = [&](bool upper) {
    const auto at = [&](std::size_t a) {
      return static_cast<Nm>(low[a] + (-shift[a] + (upper ? std::int64_t{window.count[a]} : 0)) * kEdge);
    };
    return Point3{at(0), at(1), at(2)};
  };
  window.box.add(corner(false));
  window.box.add(corner(true));
  const Result<VoxelStack> plan = pipeline::bead_voxels(*file, *pile, window);
  ASSERT_TRUE(plan.ok());
  std::vector<bool> solid(static_cast<std::size_t>(kSide * kSide * kHigh));
  const auto index = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
    return static_cast<std::size_t>(x + kSide * (y + kSide * z));
  };
  for (std::uint32_t z = 0; z < kHigh; ++z)
    for (std::uint32_t y = 0; y < kSide; ++y) {
      const auto row = plan->view().row(y, z);
      for (std::size_t i = 0; i + 1 < row.size(); i += 2)
        for (std::uint32_t x = row[i]; x < row[i + 1]; ++x) solid[index(x, y, z)] = true;
    }
  for (const bool grown : {false, true}) {
    const std::string name = grown ? "grown" : "same";
    fs::create_directory(folder / name);
    for (std::int64_t z = 0; z < kHigh; ++z) {
      write_pbm(numbered(folder / name, static_cast<int>(z), ".pbm"), kSide, kSide, [&](std::int64_t x, std::int64_t r) {
        const std::int64_t y = kSide - 1 - r;
        const auto is = [&](std::int64_t i, std::int64_t j, std::int64_t k) {
          return i >= 0 && j >= 0 && k >= 0 && i < kSide && j < kSide && k < kHigh && solid[index(i, j, k)];
        };
        return is(x, y, z) || (grown && (is(x - 1, y, z) || is(x + 1, y, z) || is(x, y - 1, z) || is(x, y + 1, z) ||
                                         is(x, y, z - 1) || is(x, y, z + 1)));
      });
    }
    const nlohmann::json json = reported("lines.gcode --scan " + name + " --pixel 25 --dark --range 8 --window 1.6,1.6,0.9");
    ASSERT_TRUE(json.contains("shift_voxels"));
    EXPECT_EQ(json["shift_voxels"], (nlohmann::json{3, -2, 1})) << name;
    EXPECT_EQ(json["voxels"], (nlohmann::json{64, 64, 36}));
    EXPECT_NEAR(json["shift_mm"][1].get<double>(), -0.05, 1e-9);
    EXPECT_EQ(json["plan_alone_voxels"], 0) << name;
    EXPECT_TRUE(json["found"].get<bool>()) << name;
    if (!grown) {
      EXPECT_EQ(json["differing"].get<double>(), 0);
      EXPECT_EQ(json["wall_mm"].get<double>(), 0);
    } else {
      // A voxel to each of six sides moves a slanting wall by less than one.
      EXPECT_GT(json["wall_mm"].get<double>(), 0.8 * 0.025);
      EXPECT_LT(json["wall_mm"].get<double>(), 1.1 * 0.025);
      EXPECT_NEAR(json["width_mm"].get<double>(), 2 * json["wall_mm"].get<double>(), 1e-12);
    }
  }
  const test::Outcome dark = run("lines.gcode --scan same --pixel 25 --range 8 --window 1.6,1.6,0.9");
  EXPECT_NE(dark.err.find("hardly matches the plan"), std::string::npos) << "solid and void exchanged" << dark.err;
  EXPECT_NE(run("lines.gcode --scan same --pixel 25 --dark --range 2.5").err.find("--range: '2.5'"), std::string::npos);
  EXPECT_NE(run("lines.gcode --scan absent --pixel 25").err.find("absent: the folder cannot be read: "), std::string::npos);
  const test::Outcome outcome = run("lines.gcode --scan same --pixel 25 --dark --window 3,3,0.6");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("take a smaller --window or --range"), std::string::npos) << outcome.err;
}

/// Two towers 20 mm apart: the middle of the print is air.
TEST_F(ImageStack, OfPartsWithAirBetweenThemIsOneLine) {
  std::ofstream file(folder / "towers.gcode");
  file << "G21\nG90\nM83\n";
  for (int layer = 1; layer <= 8; ++layer) {
    file << ";LAYER_CHANGE\n;Z:" << 0.3 * layer << "\n;HEIGHT:0.3\nG1 Z" << 0.3 * layer << " F600\n;WIDTH:0.5\n";
    for (const int x : {10, 30})
      for (int line = 0; line < 8; ++line)
        file << "G0 X" << x << " Y" << 10 + 0.5 * line << "\nG1 X" << x + 4 << " Y" << 10 + 0.5 * line << " E0.3 F900\n";
  }
  file.close();
  for (const std::string call : {"towers.gcode --window 2,2,0.6 --voxel 50", "towers.gcode --voxel 50 --no-flow"}) {
    const test::Outcome outcome = run(call);
    EXPECT_EQ(outcome.code, call.ends_with("--no-flow") ? 0 : 3) << "without a flow, the other results are still reported";
    EXPECT_NE(outcome.err.find("towers.gcode: no bead lies in the window of 2.000 x 2.000"), std::string::npos) << outcome.err;
  }
  EXPECT_EQ(run("towers.gcode --window 24,3,0.6 --voxel 100 --no-flow").code, 0);
}

}  // namespace
}  // namespace lamina
