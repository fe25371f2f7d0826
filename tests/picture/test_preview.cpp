// The program lamina-preview on a small job directory.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "pipeline/manifest/manifest.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/file.h"
#include "tests/formats/images.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

struct PreviewOutcome {
  int code = -1;
  std::string output;  // stdout and stderr
};

PreviewOutcome preview(const std::string& arguments) {
  const std::string program = (fs::path(LAMINA_PROGRAM).parent_path() / "lamina-preview").string();
  PreviewOutcome outcome;
  std::FILE* pipe = ::popen((program + " " + arguments + " 2>&1").c_str(), "r");
  char part[256];
  while (std::fgets(part, sizeof part, pipe) != nullptr) outcome.output += part;
  const int status = ::pclose(pipe);
  if (WIFEXITED(status)) outcome.code = WEXITSTATUS(status);
  return outcome;
}

/// 20 layers on a bed of 25.4 x 12.7 mm at 300 x 150 dpi (300 x 75 pixels): a block that becomes narrower.
class Preview : public ::testing::Test {
 protected:
  void SetUp() override { make_job("tiff-g4"); }

  void make_job(const std::string& id) {
    const formats::ImageFormat* format = formats::find_image_format(id);
    ManifestHead head;
    head.version = "0";
    head.format = id;
    head.extension = format->extension;
    head.fill_rule = "nonzero";
    head.mirror = "none";
    head.grid = {PixelAxis(300, 25'400'000), PixelAxis(150, 12'700'000)};
    head.layer_count = head.last_layer = 20;
    PartSummary part;
    part.path = "some \xC3\xA9 part.stl";
    head.parts = {part};
    fs::create_directories(folder_ / "layers");
    auto writer = ManifestWriter::open(folder_ / "manifest.json", head, {});
    ASSERT_TRUE(writer.ok()) << writer.error().message;
    for (std::uint32_t k = 0; k < 20; ++k) {
      std::vector<formats::testing::Row> rows(75);
      for (std::uint32_t r = 20; r < 50; ++r) rows[r] = {100 + 2 * k, 200 - 2 * k};
      const Runs runs = formats::testing::image_of(300, rows);
      const formats::Bytes file = formats::testing::encoded(*format, runs, 300, 150);
      if (!head.extension.empty()) {
        ASSERT_TRUE(write_file(folder_ / layer_file_name(k, head.extension), file).ok());
      }
      LayerRecord record{};
      record.layer = {k, static_cast<Nm>(k * 100'000), 100'000};
      record.bytes = file.size();
      record.hash = hash_bytes(file);
      record.set_pixels = set_pixels(runs);
      ASSERT_TRUE(writer->append(record).ok());
    }
    ASSERT_TRUE(writer->finish().ok());
  }

  std::string directory() const { return folder_ / ""; }
  std::string sheet() const { return folder_ / "sheet.png"; }

  /// Width and height from the PNG's header.
  std::pair<std::uint32_t, std::uint32_t> size() const {
    const std::string file = formats::testing::load(sheet());
    if (file.size() < 24) return {0, 0};
    const auto number = [&](std::size_t at) {
      std::uint32_t value = 0;
      for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(file[at + i]);
      return value;
    };
    return {number(16), number(20)};
  }

  formats::testing::Folder folder_;
};

TEST_F(Preview, MakesAContactSheetOfTheWantedWidthAndTheSameBytesEachTime) {
  const PreviewOutcome first = preview(directory() + " -o " + sheet() + " --width 900");
  ASSERT_EQ(first.code, 0) << first.output;
  EXPECT_NE(first.output.find("12 of 20 layers"), std::string::npos) << first.output;
  EXPECT_EQ(size().first, 900u);
  const std::string bytes = formats::testing::load(sheet());
  EXPECT_EQ(preview(directory() + " -o " + sheet() + " --width 900 --quiet").output, "");
  EXPECT_EQ(formats::testing::load(sheet()), bytes);
}

TEST_F(Preview, ASingleLayerIsNeverWiderThanRequested) {
  for (const char* options : {"--layer 0 --width 300", "--layer 19 --whole-bed --width 2000", "--every 7", "--count 1"}) {
    const PreviewOutcome outcome = preview(directory() + " -o " + sheet() + " " + options);
    ASSERT_EQ(outcome.code, 0) << outcome.output;
    EXPECT_GT(size().first, 0u) << options;
    EXPECT_LE(size().first, 2400u) << options;
  }
  preview(directory() + " -o " + sheet() + " --layer 0 --width 300");
  EXPECT_EQ(size().first, 300u);
}

TEST_F(Preview, AnInterruptedJobIsDrawnAsFarAsItIs) {
  fs::rename(folder_ / "manifest.json", folder_ / "manifest.json.part");
  EXPECT_EQ(preview(directory() + " -o " + sheet()).code, 0);
  // Of layers that are not there yet none is counted as drawn.
  std::ifstream whole(folder_ / "manifest.json.part");
  std::string text;
  for (std::string line; std::getline(whole, line) && line.find("000013.tif") == std::string::npos;) text += line + "\n";
  std::ofstream(folder_ / "manifest.json.part") << text;
  const PreviewOutcome part = preview(directory() + " -o " + sheet());
  EXPECT_EQ(part.code, 0);
  EXPECT_NE(part.output.find("12 of 13 layers that are there, of 20"), std::string::npos) << part.output;
}

TEST_F(Preview, WrongUseIsExitCodeTwoAndOneLine) {
  const std::string good = directory() + " -o " + sheet();
  for (const std::string& arguments :
       {std::string(""), directory(), "-o " + sheet(), good + " --layer 20", good + " --layer x", good + " --count 0",
        good + " --count 9999", good + " --every 0", good + " --layer 1 --count 2", good + " --width 10", good + " --nonsense",
        directory() + " -o " + (folder_ / "sheet.jpg"), good + " more"}) {
    const PreviewOutcome outcome = preview(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments << "\n" << outcome.output;
    EXPECT_EQ(std::count(outcome.output.begin(), outcome.output.end(), '\n'), 1) << outcome.output;
    EXPECT_FALSE(fs::exists(sheet())) << arguments;
  }
}

TEST_F(Preview, ADirectoryThatIsNotWholeIsExitCodeFive) {
  fs::resize_file(folder_ / "layers/000003.tif", 100);
  PreviewOutcome outcome = preview(directory() + " -o " + sheet() + " --layer 3");
  EXPECT_EQ(outcome.code, 5);
  EXPECT_NE(outcome.output.find("000003.tif"), std::string::npos) << outcome.output;
  fs::remove(folder_ / "layers/000003.tif");
  EXPECT_EQ(preview(directory() + " -o " + sheet() + " --every 1").code, 5);
  const Runs other = formats::testing::image_of(301, std::vector<formats::testing::Row>(75));
  formats::testing::save(folder_ / "layers/000003.tif",
                         formats::testing::encoded(*formats::find_image_format("tiff-g4"), other));
  outcome = preview(directory() + " -o " + sheet() + " --layer 3");
  EXPECT_EQ(outcome.code, 5);
  EXPECT_NE(outcome.output.find("000003.tif: is not the file of the manifest"), std::string::npos) << outcome.output;
  formats::testing::save(folder_ / "manifest.json", std::as_bytes(std::span("{\"nothing\":", 11)));
  EXPECT_EQ(preview(directory() + " -o " + sheet()).code, 5);
  EXPECT_EQ(preview((folder_ / "layers") + " -o " + sheet()).code, 5);
  EXPECT_FALSE(fs::exists(sheet()));
}

TEST_F(Preview, AJobWithoutImagesSaysSo) {
  fs::remove_all(folder_ / "layers");
  make_job("null");
  const PreviewOutcome outcome = preview(directory() + " -o " + sheet());
  EXPECT_EQ(outcome.code, 5);
  EXPECT_NE(outcome.output.find("null"), std::string::npos) << outcome.output;
}

TEST_F(Preview, APictureThatCannotBeWrittenIsExitCodeFour) {
  EXPECT_EQ(preview(directory() + " -o " + (folder_ / "no/sheet.png")).code, 4);
}

}  // namespace
}  // namespace lamina::pipeline
