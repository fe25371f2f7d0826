// Layer images as parts: what lamina jet made of a mesh and takes as images gives the same bytes, whole, resumed, in shards, on
// a printer and next to meshes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

namespace lamina {
namespace {

namespace fs = std::filesystem;

class ImageParts : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("lamina-image-parts-" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// Exit code and what stdout and stderr say.
  std::pair<int, std::string> run(const std::string& line) const {
    const std::string command = "cd " + folder_.string() + " && " + LAMINA_PROGRAM + " " + line + " --quiet 2>&1";
    std::string out;
    FILE* pipe = popen(command.c_str(), "r");
    char buffer[4096];
    for (std::size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) out.append(buffer, n);
    return {WEXITSTATUS(pclose(pipe)), out};
  }
  void done(const std::string& line) const {
    const auto [code, out] = run(line);
    ASSERT_EQ(code, 0) << line << "\n" << out;
  }
  std::vector<std::string> layers(const std::string& name, const std::string& below = "layers") const {
    std::vector<fs::path> paths;
    for (const auto& entry : fs::directory_iterator(folder_ / name / below)) paths.push_back(entry.path());
    std::ranges::sort(paths);
    std::vector<std::string> bytes;
    for (const fs::path& path : paths) {
      std::ifstream file(path, std::ios::binary);
      bytes.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    }
    return bytes;
  }
  static std::string part(const std::string& name) { return std::string(LAMINA_TEST_DIR) + "/corpus/" + name; }

  fs::path folder_;
};

TEST_F(ImageParts, GiveTheBytesOfTheMeshesThatTheyWereMadeOfInEveryFormatThatReportsItsResolution) {
  const std::string mesh = part("parameter_quality_nut.stl");
  for (const char* grid : {"--bed 31x29.3 --dpi 150", "--bed 40x37 --dpi 203x127"}) {
    for (const char* format : {"tiff-g4", "tiff-deflate", "tiff-packbits", "tiff-none", "png", "bmp", "pbm"}) {
      const std::string rest = std::string(" --layer 0.9 --format ") + format + " " + grid;
      done("jet " + mesh + rest + " -o first");
      done("jet first" + rest + " -o again");
      EXPECT_EQ(layers("again"), layers("first")) << format << " " << grid;
      ASSERT_GT(layers("first").size(), 20u);
      for (const char* name : {"first", "again"}) fs::remove_all(folder_ / name);
    }
  }
}

TEST_F(ImageParts, AreResumedSharedOutAndMergedWithMeshes) {
  const std::string mesh = part("parameter_quality_nut.stl"), rest = " --layer 0.9 --bed 60x40 --dpi 100";
  done("jet " + mesh + rest + " --at 2,3 -o slices");
  done("jet slices" + rest + " -o whole");
  fs::remove(folder_ / "whole/layers/000003.tif");
  const auto expected = layers("slices");
  done("jet slices" + rest + " -o whole --resume");
  EXPECT_EQ(layers("whole"), expected);
  done("jet slices" + rest + " -o shards --shard 1/2");
  done("jet slices" + rest + " -o shards --shard 2/2");
  done("merge shards -o merged");
  EXPECT_EQ(layers("merged"), expected);
  done("verify merged");
  // A second mesh next to the images is the same as both meshes.
  std::ofstream(folder_ / "meshes.toml") << "[[part]]\npath = \"" << mesh << "\"\nat_mm = [2, 3]\n[[part]]\npath = \"" << mesh
                                         << "\"\nat_mm = [35, 3]\n";
  std::ofstream(folder_ / "mixed.toml") << "[[part]]\npath = \"slices\"\n[[part]]\npath = \"" << mesh
                                        << "\"\nat_mm = [35, 3]\n";
  done("jet --job meshes.toml" + rest + " -o meshes");
  done("jet --job mixed.toml" + rest + " -o mixed --inspect");
  EXPECT_EQ(layers("mixed"), layers("meshes"));
}

TEST_F(ImageParts, GoThroughAPrinterAsMeshesDo) {
  const std::string mesh = part("parameter_quality_nut.stl"), rest = " --layer 2 --machine nuferbj";
  done("jet " + mesh + rest + " -o first");
  done("jet first" + rest + " -o again");
  EXPECT_EQ(layers("again"), layers("first"));
  EXPECT_EQ(layers("again", "program"), layers("first", "program"));
  done("verify again");
  done("report again -o again.html");
}

TEST_F(ImageParts, ThatAreNoGoodAreOneLineEach) {
  const std::string mesh = part("parameter_quality_nut.stl"), rest = " --layer 0.9 --bed 60x40 --dpi 100";
  done("jet " + mesh + rest + " -o slices");
  const auto refused = [&](const std::string& line, const std::string& words) {
    fs::remove_all(folder_ / "out");
    const auto [code, out] = run(line);
    EXPECT_TRUE(code == 2 || code == 3) << line << " " << code << out;
    EXPECT_EQ(std::ranges::count(out, '\n'), 1) << out;
    EXPECT_NE(out.find(words), std::string::npos) << out;
  };
  refused("jet slices --layer 0.9 --bed 60x40 --dpi 200 -o out", "dpi");
  refused("jet slices --layer 0.5 --bed 60x40 --dpi 100 -o out", "layer");
  refused("jet slices --layer 0.9 --bed 20x20 --dpi 100 -o out", "bed");
  refused("slice slices --layer 0.9 -o out", "images");
  refused("extrude slices --layer 0.9 -o out.gcode", "images");
  fs::copy(folder_ / "slices/layers", folder_ / "gap", fs::copy_options::recursive);
  fs::remove(folder_ / "gap/000002.tif");
  refused("jet gap" + rest + " -o out", "2");
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  fs::copy(folder_ / "slices/layers", folder_ / "cut", fs::copy_options::recursive);
  fs::resize_file(folder_ / "cut/000004.tif", 60);
  refused("jet cut" + rest + " -o out", "000004.tif");
  fs::copy(folder_ / "slices/layers", folder_ / "size", fs::copy_options::recursive);
  done("jet " + mesh + " --layer 0.9 --bed 50x40 --dpi 100 -o other");
  fs::copy(folder_ / "other/layers/000001.tif", folder_ / "size/000001.tif", fs::copy_options::overwrite_existing);
  refused("jet size" + rest + " -o out", "000001.tif");
  fs::create_directory(folder_ / "empty");
  refused("jet empty" + rest + " -o out", "empty");
}

}  // namespace
}  // namespace lamina
