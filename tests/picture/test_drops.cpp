// Pictures of jobs whose pixels get several drops: what `lamina preview` draws, against what OpenImageIO reads in the images.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

using Rgb = std::array<int, 3>;
constexpr Rgb kWhite{255, 255, 255}, kDark{27, 38, 59}, kOrange{217, 72, 15}, kCellFrame{214, 208, 196};

struct Picture {
  int width = 0, height = 0;
  std::vector<Rgb> pixel;
  const Rgb& at(int x, int y) const { return pixel[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + x]; }
};

/// Grey has one value thrice.
Picture read_picture(const std::string& path) {
  const auto file = OIIO::ImageInput::open(path);  // ImageBuf would remember an earlier file of this name
  if (!file) {
    ADD_FAILURE() << path << ": " << OIIO::geterror();
    return {};
  }
  Picture picture{file->spec().width, file->spec().height, {}};
  const auto channels = static_cast<std::size_t>(file->spec().nchannels);
  std::vector<std::uint8_t> samples(file->spec().image_pixels() * channels);
  EXPECT_TRUE(file->read_image(0, 0, 0, file->spec().nchannels, OIIO::TypeDesc::UINT8, samples.data())) << file->geterror();
  for (std::size_t i = 0; i < samples.size(); i += channels)
    picture.pixel.push_back({samples[i], samples[i + (channels > 2 ? 1 : 0)], samples[i + (channels > 2 ? 2 : 0)]});
  return picture;
}

/// The insides of the frames on a sheet, from the top, then from the left.
std::vector<Picture> cells_of(const Picture& sheet) {
  const auto frame = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < sheet.width && y < sheet.height && sheet.at(x, y) == kCellFrame;
  };
  std::vector<Picture> cells;
  for (int y = 0; y < sheet.height; ++y) {
    for (int x = 0; x < sheet.width; ++x) {
      if (!frame(x, y) || frame(x - 1, y) || frame(x, y - 1) || !frame(x + 1, y) || !frame(x, y + 1)) continue;
      int right = x, bottom = y;
      while (frame(right + 1, y)) ++right;
      while (frame(x, bottom + 1)) ++bottom;
      Picture cell{right - x - 1, bottom - y - 1, {}};
      if (cell.width < 16 || cell.height < 16) continue;
      for (int row = y + 1; row < bottom; ++row)
        for (int column = x + 1; column < right; ++column) cell.pixel.push_back(sheet.at(column, row));
      cells.push_back(std::move(cell));
    }
  }
  return cells;
}

/// How much of `ink` a pixel has, 0 to 1; a pixel of no such tone is an error.
double tone(const Rgb& pixel, const Rgb& ink) {
  const double share = (255.0 - pixel[0] + 255.0 - pixel[1] + 255.0 - pixel[2]) / (765.0 - ink[0] - ink[1] - ink[2]);
  for (std::size_t c = 0; c < 3; ++c) {
    if (std::abs(255 + share * (ink[c] - 255) - pixel[c]) > 2) return std::nan("");
  }
  return share;
}

constexpr int kLayer = 10;

class DropPictures : public ::testing::Test {
 protected:
  void SetUp() override { write_box(in_ / "box.stl", {0, 0, 0}, {12, 8, 1}); }

  void plan(const std::string& options, const std::string& out, const std::string& images = "drops") {
    std::vector<std::string> words =
        words_of("jet box.stl --layer 0.05 --machine nuferbj --images " + images + " " + options);
    words.insert(words.end(), {"--quiet", "-o", out});
    const Outcome planned = run_lamina(words, in_.path());
    ASSERT_EQ(planned.code, 0) << planned.err;
  }

  std::vector<Picture> draw(const std::string& of, const std::string& options) {
    const Outcome drawn = run_lamina(words_of("preview " + of + " -o " + of + ".png --quiet " + options), in_.path());
    EXPECT_EQ(drawn.code, 0) << drawn.err;
    return cells_of(read_picture(in_ / (of + ".png")));
  }

  /// Nothing is drawn; one line names the file and the next step.
  void expect_named(const std::string& line, const std::string& file) {
    std::filesystem::remove(in_ / "out.png");
    const Outcome drawn = run_lamina(words_of("preview out -o out.png " + line), in_.path());
    EXPECT_EQ(drawn.code, 5) << drawn.err;
    EXPECT_EQ(drawn.error_lines(), 1u) << drawn.err;
    EXPECT_NE(drawn.err.find("out/" + file + ": "), std::string::npos) << drawn.err;
    EXPECT_NE(drawn.err.find("run lamina verify"), std::string::npos) << drawn.err;
    EXPECT_FALSE(std::filesystem::exists(in_ / "out.png")) << line;
  }

  /// Drops of every pixel of a layer, from the images of its drops.
  std::vector<int> drops_in_files(const std::string& of) {
    std::vector<int> drops;
    for (int drop = 1; drop <= kMax; ++drop) {
      const Picture plane =
          read_picture(in_ / (of + "/layers/0000" + std::to_string(kLayer) + "-drop" + std::to_string(drop) + ".tif"));
      drops.resize(plane.pixel.size());
      for (std::size_t i = 0; i < drops.size(); ++i) drops[i] += plane.pixel[i] == kWhite ? 0 : 1;
    }
    return drops;
  }

  static constexpr int kMax = 8;
  const std::string several_ = "--saturation 200 --shell 1 --core-saturation 20";  // 7 or 8 drops, and 0 or 1
  Directory in_;
};

TEST_F(DropPictures, APixelIsAsDarkAsItsShareOfTheMaxDrops) {
  plan(several_, "out");
  const std::vector<int> drops = drops_in_files("out");
  ASSERT_EQ(*std::ranges::max_element(drops), kMax);
  const std::vector<Picture> cells = draw("out", "--layer 10 --whole-bed --width 2000");
  ASSERT_EQ(cells.size(), 1u);
  ASSERT_GE(cells[0].pixel.size(), drops.size());
  // The bed is drawn larger than its pixels: each stands as a block around its middle.
  const int side = 1011;
  ASSERT_EQ(drops.size(), static_cast<std::size_t>(side) * side);
  const int left = (cells[0].width - cells[0].height) / 2;
  for (int r = 0; r < side; ++r) {
    for (int c = 0; c < side; ++c) {
      const double scale = static_cast<double>(cells[0].height) / side;
      const auto middle = [&](int of) { return static_cast<int>((of + 0.5) * scale); };
      const double detected = tone(cells[0].at(left + middle(c), middle(r)), kDark);
      ASSERT_NEAR(detected, static_cast<double>(drops[static_cast<std::size_t>(r) * side + c]) / kMax, 0.01) << c << ", " << r;
    }
  }
}

TEST_F(DropPictures, ASmallPictureHasTheMeanAndGreyImagesThePictureOfTheirDrops) {
  plan(several_, "out");
  plan(several_ + " --format tiff-8", "grey");
  double wanted = 0;
  for (const int drops : drops_in_files("out")) wanted += static_cast<double>(drops) / kMax;
  for (const int width : {200, 431, 900}) {
    const std::string options = "--layer 10 --whole-bed --width " + std::to_string(width);
    const std::vector<Picture> cells = draw("out", options);
    ASSERT_EQ(cells.size(), 1u);
    double detected = 0;
    for (const Rgb& pixel : cells[0].pixel) detected += tone(pixel, kDark);
    EXPECT_NEAR(detected * 1011 * 1011 / cells[0].height / cells[0].height, wanted, wanted / 100) << width;
    draw("grey", options);
    EXPECT_TRUE(read_text(in_ / "out.png") == read_text(in_ / "grey.png")) << width;
  }
}

// A picture pixel a pixel of the bed; the head's nozzles lie over some.
TEST_F(DropPictures, ASwathShowsThoseRequestedAndThoseThatFell) {
  plan(several_, "out");
  const std::vector<int> drops = drops_in_files("out");
  draw("out", "--layer 10 --swath middle --width 1059");
  const Picture picture = read_picture(in_ / "out.png");
  constexpr Rgb kGrounds[] = {{247, 247, 244}, {236, 240, 245}, {255, 240, 214}, {176, 182, 190}}, kRequested{150, 160, 175},
                kFallen{24, 44, 92}, kNozzles[] = {{150, 95, 20}, {225, 20, 20}};
  const auto over = [](const Rgb& ground, const Rgb& ink, int of) {
    Rgb mixed;
    for (std::size_t c = 0; c < 3; ++c)
      mixed[c] = static_cast<int>(std::lround(ground[c] + (ink[c] - ground[c]) * static_cast<double>(of) / kMax));
    return mixed;
  };
  const auto alike = [](const Rgb& a, const Rgb& b) {
    return std::abs(a[0] - b[0]) <= 2 && std::abs(a[1] - b[1]) <= 2 && std::abs(a[2] - b[2]) <= 2;
  };
  std::array<std::array<int, kMax + 1>, kMax + 1> detected{};  // pixels by drops requested and fallen
  for (int r = 0; r < 1011; ++r) {
    for (int c = 0; c < 1011; ++c) {
      const int requested = drops[static_cast<std::size_t>(r) * 1011 + static_cast<std::size_t>(c)];
      const Rgb& pixel = picture.at(24 + c, 58 + r);
      if (requested == 0 || std::ranges::find(kNozzles, pixel) != std::end(kNozzles)) continue;
      int fallen = requested;
      const auto is = [&](const Rgb& ground) {
        return alike(pixel, over(over(ground, kRequested, requested), kFallen, fallen));
      };
      while (fallen >= 0 && std::ranges::none_of(kGrounds, is)) --fallen;
      ASSERT_GE(fallen, 0) << c << ", " << r << ": " << requested << " drops, " << pixel[0] << ' ' << pixel[1] << ' '
                           << pixel[2];
      ++detected[static_cast<std::size_t>(requested)][static_cast<std::size_t>(fallen)];
    }
  }
  for (const auto& [requested, fallen] : {std::pair{1, 0}, {1, 1}, {kMax, 0}, {kMax, kMax}})
    EXPECT_GT(detected[static_cast<std::size_t>(requested)][static_cast<std::size_t>(fallen)], 20)
        << requested << " " << fallen;
  EXPECT_TRUE(std::ranges::find(picture.pixel, kGrounds[2]) != picture.pixel.end()) << "where the head passes now";
}

TEST_F(DropPictures, OneDropIsDrawnAsSetRegardlessOfTheFormat) {
  plan("--saturation 20", "out");
  plan("--saturation 20 --format png-8", "grey");
  const std::vector<Picture> cells = draw("out", "--layer 10 --width 300");
  draw("grey", "--layer 10 --width 300");
  EXPECT_TRUE(read_text(in_ / "out.png") == read_text(in_ / "grey.png"));
  EXPECT_TRUE(std::ranges::find(cells.at(0).pixel, kDark) != cells.at(0).pixel.end());
}

TEST_F(DropPictures, AMaterialKeepsItsColourAndOneCellALayer) {
  plan("box.stl " + several_ + " --material steel,bronze --vat-rule first", "out");
  const std::vector<Picture> cells = draw("out", "--layer 10");
  ASSERT_EQ(cells.size(), 2u);
  for (std::size_t m = 0; m < 2; ++m) {
    int full = 0, pale = 0;
    for (const Rgb& pixel : cells[m].pixel) {
      const double share = tone(pixel, m == 0 ? kDark : kOrange);  // bronze falls into the powder of steel
      ASSERT_FALSE(std::isnan(share)) << pixel[0] << ' ' << pixel[1] << ' ' << pixel[2];
      full += share > 0.99 ? 1 : 0, pale += share > 0.05 && share < 0.3 ? 1 : 0;
    }
    EXPECT_GT(full, 100) << m;
    EXPECT_GT(pale, 100) << m;
  }
}

TEST_F(DropPictures, ImagesOfTheGeometryAreDrawnWithTheDropsOfTheirJob) {
  for (const std::string& dose : {several_, std::string("--saturation 20"), std::string("--shell 1 --core 0.3")}) {
    plan(dose + " --overwrite", "out");
    plan(dose + " --overwrite", "made", "geometry");
    for (const std::string options : {"--layer 10 --width 1200", "--count 3 --width 700", "--layer 10 --swath middle"}) {
      draw("out", options);
      draw("made", options);
      EXPECT_TRUE(read_text(in_ / "out.png") == read_text(in_ / "made.png")) << dose << " " << options;
    }
  }
  // Without the machine nothing is known of the drops.
  std::filesystem::remove(in_ / "made/program/machine.toml");
  const Outcome drawn = run_lamina(words_of("preview made -o made.png --layer 10"), in_.path());
  EXPECT_EQ(drawn.code, 0) << drawn.err;
  EXPECT_NE(drawn.err.find("made/program/machine.toml: is missing; the geometry of layers is drawn without their drops"),
            std::string::npos)
      << drawn.err;
  const auto cells = cells_of(read_picture(in_ / "made.png"));
  // Only pixels on the outline of a part are neither.
  const auto dark = std::ranges::count(cells.at(0).pixel, kDark), white = std::ranges::count(cells.at(0).pixel, kWhite);
  const auto between = static_cast<std::ptrdiff_t>(cells.at(0).pixel.size()) - dark - white;
  EXPECT_GT(dark, 1000);
  EXPECT_LT(between, dark / 20);
}

TEST_F(DropPictures, FilesThatAreNotThoseOfTheManifestAreNamed) {
  plan("--saturation 20", "out", "geometry");
  const std::string program = "program/000010.gcode", image = "layers/000010.tif";
  const std::string was = read_text(in_ / ("out/" + program));
  write_text(in_ / ("out/" + program), was.substr(0, was.size() / 2));
  expect_named("--layer 10 --swath middle", program);
  std::filesystem::remove(in_ / ("out/" + program));
  expect_named("--layer 10 --swath middle", program);
  write_text(in_ / ("out/" + program), was);
  draw("out", "--layer 10 --swath middle");
  // An image of another job, of the same size.
  plan("--saturation 20 --at 40,40", "other", "geometry");
  std::filesystem::copy_file(in_ / ("other/" + image), in_ / ("out/" + image),
                             std::filesystem::copy_options::overwrite_existing);
  expect_named("--layer 10 --swath middle", image);
  expect_named("--layer 10", image);
  expect_named("--every 1", image);
  draw("out", "--layer 9");
}

}  // namespace
}  // namespace lamina::test
