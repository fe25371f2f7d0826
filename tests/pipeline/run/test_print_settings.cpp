// tests/pipeline/run/test_print_settings.cpp: whole extrusion jobs with travels inside, wipes, minimum layer times, progress,
// objects and a thumbnail.
#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/commands/program.h"
#include "tests/formats/gcode_steps.h"

namespace lamina::test {
namespace {

const std::string kAll =
    "retraction.inside=true;retraction.detour_mm=30;retraction.wipe_mm=1.5;retraction.lift_mm=0.2;fan.min_layer_s=12;"
    "fan.full_layer=4;code.progress=true;code.objects=m486;code.thumbnail_px=64,40";

/// Two crowns, of 30 layers.
std::string crowns(const std::string& machine_keys, const std::string& options = "") {
  return "extrude " + corpus_file("dental_crown.stl") + " --copies 2 --layer 0.3 --machine marlin --quiet --machine-set " +
         machine_keys + " " + options;
}

struct PrintFile {
  std::string text;
  nlohmann::json summary;
};

PrintFile print_file(const Directory& directory, const std::string& call) {
  const Outcome outcome = run_lamina(words_of(call + " --overwrite --json -o a.gcode"), directory.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  return {read_text(directory / "a.gcode"), nlohmann::json::parse(outcome.out, nullptr, false)};
}

std::vector<std::string> lines_with(const std::string& text, const std::string& start) {
  std::vector<std::string> found;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(start, 0) == 0) found.push_back(line);
  }
  return found;
}

TEST(PrintSettings, GiveTheSameBytesForAnyThreadsAndOnAStream) {
  const Directory directory;
  const std::string text = print_file(directory, crowns(kAll)).text;
  ASSERT_FALSE(text.empty());
  for (const char* threads : {"1", "3"}) {
    const Outcome stream = run_lamina(words_of(crowns(kAll, "--threads ") + threads + " -o -"), directory.path());
    EXPECT_EQ(stream.code, 0) << stream.err;
    EXPECT_TRUE(stream.out == text) << threads;
  }
  EXPECT_EQ(run_lamina(words_of("verify a.gcode"), directory.path()).code, 0);
}

TEST(PrintSettings, ChangeTravelsAndTimesAndNoBead) {
  const Directory directory;
  const PrintFile plain = print_file(directory, crowns("skirt.loops=1")), all = print_file(directory, crowns(kAll));
  for (const char* key : {"volume_mm3", "filament_mm", "moves", "travels"})
    EXPECT_EQ(plain.summary[key], all.summary[key]) << key;
  EXPECT_LT(all.summary["retractions"].get<double>(), 0.8 * plain.summary["retractions"].get<double>());
  EXPECT_GT(all.summary["print_seconds"].get<double>(), plain.summary["print_seconds"].get<double>());
  for (const bool relative : {true, false}) {
    const GcodeSteps read =
        read_steps(print_file(directory, crowns(kAll + (relative ? "" : ";code.relative_extrusion=false"))).text);
    for (const double back : read.back_at_layer) EXPECT_NEAR(back, 1, 1e-9);
    double fed = 0;
    for (const GcodeStep& step : read.steps) {
      if (step.fed > 0 && step.moves()) fed += step.fed;
    }
    EXPECT_NEAR(fed, all.summary["filament_mm"].get<double>(), 1e-3);
  }
}

TEST(PrintSettings, ProgressRisesAndEndsAndKeepsNearTheTime) {
  const Directory directory;
  const PrintFile file = print_file(directory, crowns("fan.min_layer_s=40;code.progress=true"));
  const std::vector<std::string> progress = lines_with(file.text, "M73 ");
  const std::size_t layers = lines_with(file.text, ";LAYER_CHANGE").size();
  ASSERT_EQ(progress.size(), layers + 1);
  EXPECT_EQ(progress.back(), "M73 P100 R0");
  int before = -1, minutes = 1 << 20;
  for (const std::string& line : progress) {
    int percent = 0, left = 0;
    ASSERT_EQ(std::sscanf(line.c_str(), "M73 P%d R%d", &percent, &left), 2);
    EXPECT_GE(percent, before);
    EXPECT_LE(left, minutes);
    before = percent, minutes = left;
  }
  int percent = 0, left = 0;
  std::sscanf(progress.front().c_str(), "M73 P%d R%d", &percent, &left);
  EXPECT_EQ(percent, 0);
  EXPECT_NEAR(left, file.summary["print_seconds"].get<double>() / 60, 1.0);
}

TEST(PrintSettings, ObjectsAreTheCopiesAndAllBeadsButTheSkirtAreInOne) {
  const Directory directory;
  const std::string text = print_file(directory, crowns(kAll)).text;
  EXPECT_EQ(lines_with(text, "M486 T"), std::vector<std::string>({"M486 T2"}));
  EXPECT_EQ(lines_with(text, "; object"), std::vector<std::string>({"; object 0: dental_crown", "; object 1: dental_crown_2"}));
  std::istringstream lines(text);
  std::string type;
  int object = -1, inside[2] = {};
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(";TYPE:", 0) == 0) type = line.substr(6);
    if (line.rfind("M486 S", 0) == 0) object = std::stoi(line.substr(6));
    if (line.rfind("G1 X", 0) != 0 || line.find(" E") == std::string::npos || line.find(" E-") != std::string::npos) continue;
    ASSERT_EQ(object < 0, type == "Skirt/Brim") << line;
    if (object >= 0) ++inside[object];
  }
  EXPECT_EQ(inside[0], inside[1]);
  EXPECT_EQ(object, -1);
}

TEST(PrintSettings, TheThumbnailIsAPngThatShowsTheParts) {
  const Directory directory;
  const std::string text = print_file(directory, crowns(kAll)).text;
  const std::size_t begin = text.find("; thumbnail begin 64x40 "), end = text.find("; thumbnail end\n");
  ASSERT_TRUE(begin != std::string::npos && end != std::string::npos);
  std::istringstream lines(text.substr(begin, end - begin));
  std::string line, letters;
  std::getline(lines, line);
  const std::size_t count = std::stoul(line.substr(24));
  while (std::getline(lines, line)) {
    EXPECT_LE(line.size(), 80u);
    letters += line.substr(2);
  }
  ASSERT_EQ(letters.size(), count);
  const std::string alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::uint32_t bits = 0, have = 0;
  for (const char c : letters) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<std::uint32_t>(alphabet.find(c));
    if ((have += 6) >= 8) bytes += static_cast<char>(bits >> (have -= 8));
  }
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()), 0) << image.message;
  ASSERT_EQ(image.width, 64u);
  ASSERT_EQ(image.height, 40u);
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
  ASSERT_NE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr), 0);
  std::size_t dark = 0;
  for (std::size_t i = 2; i < pixels.size(); i += 3) dark += pixels[i] < 100;
  EXPECT_EQ(pixels[0], 245) << "the ground, at a corner";
  EXPECT_GT(dark, 64u * 40 / 8);
  EXPECT_LT(dark, 64u * 40 * 7 / 8);
}

}  // namespace
}  // namespace lamina::test
