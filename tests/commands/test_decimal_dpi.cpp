// Resolutions with digits after the point, wherever one is read, kept or written.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

struct DecimalDpi : testing::Test {
  Directory folder;
  void SetUp() override { write_box(folder / "part.stl", {0, 0, 0}, {9, 7, 4}); }
  Outcome done(const std::string& line) const {
    Outcome outcome = run_lamina(words_of(line), folder.path());
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    return outcome;
  }
  nlohmann::json dpi_of(const std::string& images) const {
    return nlohmann::json::parse(done("info " + images + " --json").out)["dpi"];
  }
};
constexpr const char* kJet = "jet part.stl --bed 20x20 --layer 1 --dpi 540.43x262.006 --quiet ";

/// A rational tag of a little-endian TIFF as dots and inches.
std::array<std::uint32_t, 2> rational_of(const std::string& tiff, std::uint16_t tag) {
  const auto at = [&](std::size_t position, auto value) {
    std::memcpy(&value, tiff.data() + position, sizeof value);
    return value;
  };
  const std::size_t directory = at(4, std::uint32_t{});
  for (std::size_t e = 0; e < at(directory, std::uint16_t{}); ++e) {
    const std::size_t entry = directory + 2 + 12 * e;
    if (at(entry, std::uint16_t{}) != tag) continue;
    const std::size_t value = at(entry + 8, std::uint32_t{});
    return {at(value, std::uint32_t{}), at(value + 4, std::uint32_t{})};
  }
  return {};
}

TEST_F(DecimalDpi, IsReadBackFromEveryFormat) {
  for (const char* format : {"tiff-g4", "tiff-deflate", "tiff-packbits", "tiff-none", "png", "bmp", "pbm"}) {
    const std::string out = std::string("out-") + format;
    done(std::string(kJet) + "--format " + format + " -o " + out);
    done("verify --quiet " + out);
    done("preview --quiet " + out + " -o " + out + ".png");
    const auto dpi = dpi_of(out + "/layers");
    const bool exact = out.find("tiff") != std::string::npos || out.ends_with("pbm");  // the others count pixels a metre
    EXPECT_NEAR(dpi[0].get<double>(), 540.43, exact ? 0 : 0.01) << format;
    EXPECT_NEAR(dpi[1].get<double>(), 262.006, exact ? 0 : 0.01) << format;
  }
  using Rational = std::array<std::uint32_t, 2>;
  for (const char* layer :
       {"out-tiff-g4/layers/000000.tif", "out-tiff-g4/layers/000003.tif", "out-tiff-none/layers/000001.tif"}) {
    EXPECT_EQ(rational_of(read_text(folder / layer), 282), (Rational{54043, 100})) << layer;
    EXPECT_EQ(rational_of(read_text(folder / layer), 283), (Rational{131003, 500})) << layer;
  }
  const auto manifest = read_text(folder / "out-png/manifest.json");
  EXPECT_NE(manifest.find("\"columns\": 426"), std::string::npos) << "20 mm of 540.43 dpi are 425.5 pixels";
  EXPECT_NE(manifest.find("54043 in 2540000000 nm"), std::string::npos) << manifest;
}

TEST_F(DecimalDpi, JobFilesShardsAndInterruptedJobsKeepIt) {
  done(std::string(kJet) + "-o whole --save-job job.toml");
  EXPECT_NE(read_text(folder / "job.toml").find("dpi = [540.43, 262.006]"), std::string::npos);
  done("jet --job job.toml --quiet -o again");
  done(std::string(kJet) + "-o part --layers 0:2");
  done(std::string(kJet) + "-o part --resume");
  for (const char* shard : {"1/2", "2/2"}) done(std::string(kJet) + "-o shards --shard " + shard);
  done("merge shards -o shards --quiet");
  const std::string layers = tree_text(folder.path() / "whole/layers");
  for (const char* other : {"again", "part", "shards"}) EXPECT_EQ(tree_text(folder.path() / other / "layers"), layers) << other;
}

TEST_F(DecimalDpi, ImagesOfItArePlannedResampledAndConverted) {
  done(std::string(kJet) + "-o out");
  done("jet out/layers --bed 20x20 --layer 1 --dpi 540.43x262.006 --quiet -o same");
  EXPECT_EQ(tree_text(folder.path() / "same/layers"), tree_text(folder.path() / "out/layers"));
  done("jet out/layers --bed 20x20 --layer 1 --dpi 600.5 --set part.resample=true --quiet -o other");
  done("jet part.stl --bed 20x20 --layer 1 --dpi 600.5 --quiet -o direct");
  const auto set_of = [&](const std::string& images) {
    return nlohmann::json::parse(done("info " + images + "/layers --json").out)["set_pixels"].get<double>();
  };
  EXPECT_NEAR(set_of("other") / set_of("direct"), 1, 0.02);
  done("convert out/layers --format pbm --quiet -o pbm");
  EXPECT_EQ(dpi_of("pbm"), (nlohmann::json{540.43, 262.006}));
  done("convert pbm --dpi 300.25 --quiet -o tiff");
  EXPECT_EQ(dpi_of("tiff"), (nlohmann::json{300.25, 300.25}));
}

TEST_F(DecimalDpi, OfAMachineIsThatOfItsHead) {
  done("jet part.stl --machine nuferbj --layer 1 --dpi 262.006 --quiet -o out");
  done("jet part.stl --machine nuferbj --layer 1 --quiet -o own");
  EXPECT_EQ(tree_text(folder.path() / "out/layers"), tree_text(folder.path() / "own/layers"));
  expect_refused("jet part.stl --machine nuferbj --layer 1 --dpi 262.3 --dry-run", 2, "reaches 262.01", folder);
  std::string profile = done("machines --show jet1000").out;
  profile.replace(profile.find("\nalong_dpi = 0"), 14, "\nalong_dpi = 720.25");
  write_text(folder / "mine.toml", profile);
  done("jet part.stl --machine ./mine.toml --layer 1 --quiet -o mine");
  done("verify --quiet mine");
  EXPECT_NE(read_text(folder / "mine/manifest.json").find("2881 in 101600000 nm"), std::string::npos);
}

TEST_F(DecimalDpi, BeyondWhatIsKeptIsAnError) {
  for (const char* dpi : {"540.43125", "0.5", "25400.5", "1e300"})
    expect_refused(std::string("jet part.stl --dry-run --dpi ") + dpi, 2, "--dpi: ", folder);
  expect_refused("jet part.stl --dry-run --set bed.dpi=540.43125", 2, "too many digits after the point; give at most 4",
                 folder);
}

}  // namespace
}  // namespace lamina::test
