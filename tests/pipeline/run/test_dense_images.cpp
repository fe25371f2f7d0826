// Dithered and noisy images as parts: the same pixels as their runs would give, in the memory of their bits.
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "stages/data/runs.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/bits.h"
#include "stages/geometry/combine.h"
#include "stages/raster/images.h"
#include "stages/support/io/file.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

/// 254 dpi: 300 x 200 pixels on a bed of 30 x 20 mm.
Runs noise_of(std::uint32_t columns, std::uint32_t rows, std::uint32_t seed) {
  std::mt19937_64 random(seed);
  RunsBuilder builder(columns);
  std::vector<std::byte> row(row_bytes(columns) + 8);
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::byte& byte : row) byte = static_cast<std::byte>(random());
    EXPECT_TRUE(builder.add_row(row, false));
  }
  return builder.finish();
}

void save_noise(const std::string& path, const Runs& runs, double dpi, std::string_view format = "png") {
  formats::Bytes file;
  ASSERT_TRUE(formats::find_image_format(format)->make_encoder()->encode(runs.view(), dpi, dpi, file));
  ASSERT_TRUE(write_file(path, file));
}

class DenseImages : public testing::Test {
 protected:
  void done(const std::string& line) const {
    const test::Outcome outcome = test::run_lamina(test::words_of(line + " --quiet"), folder_.path());
    ASSERT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
  }
  Runs layer(const std::string& file) const {
    const auto image = formats::image(folder_ / file);
    EXPECT_TRUE(image.ok()) << image.error().message;
    return image ? image->runs : Runs();
  }
  /// MiB of a command at most.
  std::uint64_t peak(const std::string& line) const {
    rusage usage{};
    const test::Outcome outcome = test::run_lamina(test::words_of(line), folder_.path(), [&](int process) {
      siginfo_t how{};
      EXPECT_EQ(::syscall(SYS_waitid, P_PID, process, &how, WEXITED | WNOWAIT, &usage), 0);
    });
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    return static_cast<std::uint64_t>(usage.ru_maxrss) >> 10;
  }

  test::Directory folder_;
};

bool same_pixels(const Runs& a, const Runs& b) {
  return a.columns == b.columns && a.row_offset == b.row_offset && a.change == b.change;
}

constexpr const char* kJob = " --bed 30x20 --dpi 254 --layer 0.1 --at 0,0 -o ";

TEST_F(DenseImages, KeepTheirPixelsInEveryFormat) {
  const Runs noise = noise_of(300, 200, 1);
  save_noise(folder_ / "a1.png", noise, 254);
  for (const formats::ImageFormat& format : formats::image_formats()) {
    if (format.extension.empty()) continue;
    const std::string id(format.id), file = "/layers/000000" + std::string(format.extension);
    done("jet a1.png --format " + id + kJob + id);
    EXPECT_TRUE(same_pixels(layer(id + file), noise)) << id;
    done("jet a1.png --inspect --format " + id + kJob + id + "-runs");  // an inspection takes runs
    EXPECT_EQ(test::read_text(folder_ / (id + file)), test::read_text(folder_ / (id + "-runs" + file))) << id;
    done("verify " + id);
  }
}

TEST_F(DenseImages, BecomeGrey) {
  const Runs noise = noise_of(300, 200, 10);
  save_noise(folder_ / "a1.png", noise, 254);
  for (const formats::LevelFormat& format : formats::level_formats()) {
    const std::string id(format.id);
    for (const std::string how : {"", " --invert", " --mirror xy"}) {
      done("convert a1.png --overwrite --format " + id + how + " -o " + id);
      Runs expected = noise;
      if (how == " --invert") expected = formats::inverse(noise);
      if (how == " --mirror xy") raster::mirror(noise.view(), true, true, expected);
      const auto image = formats::dark_pixels(folder_ / (id + "/000000" + std::string(format.extension)), 128);
      ASSERT_TRUE(image.ok()) << image.error().message;
      EXPECT_TRUE(same_pixels(image->runs, expected)) << id << how;
    }
  }
}

TEST_F(DenseImages, AreMirroredAsRunsAre) {
  const Runs noise = noise_of(300, 200, 2);
  save_noise(folder_ / "a1.png", noise, 254);
  for (const std::string axes : {"x", "y", "xy"}) {
    Runs expected;
    raster::mirror(noise.view(), axes != "y", axes != "x", expected);
    done("jet a1.png --mirror " + axes + kJob + "jet-" + axes);
    done("convert a1.png --mirror " + axes + " -o convert-" + axes);
    EXPECT_TRUE(same_pixels(layer("jet-" + axes + "/layers/000000.tif"), expected)) << axes;
    EXPECT_TRUE(same_pixels(layer("convert-" + axes + "/000000.tif"), expected)) << axes;
  }
}

TEST_F(DenseImages, AreMergedWithEachOtherAndWithMeshes) {
  const Runs one = noise_of(300, 200, 3), other = noise_of(300, 200, 4), sparse = noise_of(40, 30, 5);
  save_noise(folder_ / "a1.png", one, 254);
  save_noise(folder_ / "b1.png", other, 254);
  save_noise(folder_ / "c1.png", sparse, 254);
  test::write_box(folder_.path() / "box.stl", {0, 0, 0}, {9, 7, 0.1F});
  Runs both, all;
  combine(one, other, SetOperation::kUnion, both);
  test::write_text(folder_.path() / "job.toml",
                   "[[part]]\npath = \"box.stl\"\nat_mm = [2, 3]\n[[part]]\npath = \"a1.png\"\nat_mm = [0, 0]\n"
                   "[[part]]\npath = \"b1.png\"\nat_mm = [0, 0]\n[[part]]\npath = \"c1.png\"\nat_mm = [1, 1]\n");
  done("jet --job job.toml --bed 30x20 --dpi 254 --layer 0.1 -o bits");
  done("jet --job job.toml --bed 30x20 --dpi 254 --layer 0.1 --inspect -o runs");
  EXPECT_EQ(test::read_text(folder_ / "bits/layers/000000.tif"), test::read_text(folder_ / "runs/layers/000000.tif"));
  combine(both, layer("bits/layers/000000.tif"), SetOperation::kUnion, all);
  EXPECT_TRUE(same_pixels(all, layer("bits/layers/000000.tif"))) << "holds both images";
  EXPECT_GT(set_pixels(layer("bits/layers/000000.tif")), set_pixels(both)) << "and the box";
}

TEST_F(DenseImages, GiveTheSamePrograms) {
  save_noise(folder_ / "a1.png", noise_of(300, 200, 6), 254);
  test::write_text(folder_.path() / "printer.toml",
                   "[machine]\nname = \"p\"\n[bed]\nsize_mm = [30, 20]\nbuild_height_mm = 9\n[mounting]\ndpi = 254\n");
  for (const std::string how : {"", " --inspect"})
    done("jet a1.png --machine printer.toml --layer 0.1 --at 0,0" + how + " -o out" + (how.empty() ? "" : "-runs"));
  EXPECT_EQ(test::tree_text(folder_.path() / "out/program"), test::tree_text(folder_.path() / "out-runs/program"));
  EXPECT_EQ(test::tree_text(folder_.path() / "out/layers"), test::tree_text(folder_.path() / "out-runs/layers"));
  done("verify out");
}

TEST_F(DenseImages, AreVerifiedByTheirCounts) {
  save_noise(folder_ / "a1.png", noise_of(300, 200, 7), 254);
  done("jet a1.png --format pbm" + std::string(kJob) + "out");
  std::string manifest = test::read_text(folder_ / "out/manifest.json");
  const std::size_t at = manifest.find("\"set_pixels\":");
  ASSERT_NE(at, std::string::npos);
  const std::size_t digit = manifest.find_first_of("0123456789", at);
  manifest[digit] = manifest[digit] == '9' ? '8' : static_cast<char>(manifest[digit] + 1);
  test::write_text(folder_.path() / "out/manifest.json", manifest);
  const test::Outcome outcome = test::run_lamina({"verify", "out"}, folder_.path());
  EXPECT_EQ(outcome.code, 5);
  EXPECT_NE(outcome.err.find("set pixels, the manifest says"), std::string::npos) << outcome.err;
}

TEST_F(DenseImages, TakeTheMemoryOfTheirBits) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the memory is the sanitizer's";
#endif
  // 64 million pixels: 8 MB of bits, 128 MB of runs, 260 MB of levels.
  save_noise(folder_ / "a1.png", noise_of(8000, 8000, 8), 508);
  const std::string job = "jet a1.png --bed 400x400 --dpi 508 --layer 0.1 --at 0,0 --memory 32M --quiet -o out";
  EXPECT_LT(peak(job), 110u);
  EXPECT_LT(peak("convert a1.png -o g4 --memory 32M --quiet"), 110u);
  EXPECT_LT(peak("convert a1.png -o mirrored --format png --mirror y --quiet"), 110u);
  EXPECT_LT(peak("info a1.png --memory 32M"), 60u);
  EXPECT_LT(peak("verify out --memory 32M"), 80u);
  EXPECT_LT(peak("preview out -o sheet.png --memory 32M"), 200u);  // 130 of them are of the libraries of pictures
  EXPECT_LT(peak("report out -o report.html --max-bytes 1k --memory 32M --quiet"), 150u);
}

TEST_F(DenseImages, MemoryIsASize) {
  save_noise(folder_ / "a1.png", noise_of(30, 20, 9), 254);
  done("jet a1.png" + std::string(kJob) + "out");
  for (const std::string line : {"convert a1.png -o x", "info a1.png", "verify out", "preview out -o x.png", "report out -o x.html"}) {
    const test::Outcome outcome = test::run_lamina(test::words_of(line + " --memory much"), folder_.path());
    EXPECT_EQ(outcome.code, 2) << line;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find("--memory"), std::string::npos) << outcome.err;
  }
}

// A budget below any image changes nothing but the time.
TEST_F(DenseImages, GiveTheSameBytesForAnyBudget) {
  std::filesystem::create_directory(folder_ / "in");
  for (std::uint32_t i = 1; i < 9; ++i) save_noise(folder_ / ("in/a" + std::to_string(i) + ".png"), noise_of(300, 200, i), 254);
  for (const std::string memory : {"1K", "1G"}) {
    done("jet in --memory " + memory + kJob + "jet-" + memory);
    done("convert in --memory " + memory + " -o convert-" + memory);
    for (const char* line : {"verify jet-1K --memory ", "preview jet-1K --overwrite -o sheet.png --memory ",
                             "report jet-1K --overwrite -o page.html --memory "})
      done(line + memory);
    const test::Outcome info = test::run_lamina({"info", "in", "--memory", memory}, folder_.path());
    EXPECT_NE(info.out.find("8 PNG"), std::string::npos) << info.out;
  }
  EXPECT_EQ(test::tree_text(folder_.path() / "jet-1K/layers"), test::tree_text(folder_.path() / "jet-1G/layers"));
  EXPECT_EQ(test::tree_text(folder_.path() / "convert-1K"), test::tree_text(folder_.path() / "convert-1G"));
}

}  // namespace
}  // namespace lamina
