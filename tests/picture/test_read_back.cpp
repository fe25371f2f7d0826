// Files of every format as OpenImageIO reads them: a reader with decoders of its own for PNM, and with its own idea of
// what bilevel TIFF and palette PNG mean.
#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "stages/data/levels.h"
#include "stages/formats/image_format.h"
#include "stages/formats/tiff/pages.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

/// One grey byte a pixel, black 0; the file's resolution in dpi goes to `dpi`.
std::vector<std::uint8_t> pixels_by_openimageio(const std::string& path, const RunsView& runs, double dpi[2]) {
  const auto input = OIIO::ImageInput::open(path);
  if (!input) {
    ADD_FAILURE() << OIIO::geterror();
    return {};
  }
  const OIIO::ImageSpec& spec = input->spec();
  EXPECT_EQ(static_cast<std::uint32_t>(spec.width), runs.columns);
  EXPECT_EQ(static_cast<std::uint32_t>(spec.height), runs.rows());
  const double unit = spec.get_string_attribute("ResolutionUnit") == "m"    ? 0.0254
                      : spec.get_string_attribute("ResolutionUnit") == "cm" ? 2.54
                                                                            : 1;
  dpi[0] = spec.get_float_attribute("XResolution") * unit;
  dpi[1] = spec.get_float_attribute("YResolution") * unit;
  const auto channels = static_cast<std::size_t>(spec.nchannels);
  std::vector<std::uint8_t> samples(spec.image_pixels() * channels), grey(spec.image_pixels());
  EXPECT_TRUE(input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UINT8, samples.data())) << input->geterror();
  for (std::size_t i = 0; i < grey.size(); ++i) grey[i] = samples[i * channels];
  return grey;
}

TEST(OpenImageIO, SeesBlackExactlyWhereRunsAreInEveryFormat) {
  const testing::Folder folder;
  for (const std::uint32_t columns : {1u, 7u, 64u, 65u, 1000u, 2561u}) {
    const Runs runs = testing::random_image(columns, columns, 60);
    std::vector<std::uint8_t> expected(std::size_t{columns} * runs.view().rows(), 255);
    for (std::uint32_t r = 0; r < runs.view().rows(); ++r) {
      const auto row = runs.view().row(r);
      for (std::size_t i = 0; i < row.size(); i += 2) {
        const auto start = expected.begin() + static_cast<std::ptrdiff_t>(std::size_t{r} * columns);
        std::fill(start + row[i], start + row[i + 1], std::uint8_t{0});
      }
    }
    for (const ImageFormat* format : testing::file_formats()) {
      SCOPED_TRACE(std::string(format->id) + ", " + std::to_string(columns) + " columns");
      const std::string path = folder / ("image" + std::string(format->extension));
      testing::save(path, testing::encoded(*format, runs, 1200, 600));
      double dpi[2] = {};
      ASSERT_EQ(pixels_by_openimageio(path, runs, dpi), expected);
      if (format->extension == ".pbm") continue;  // has no place for it but a comment
      if (format->extension == ".bmp") {          // resolution unreported by OpenImageIO: pixels a metre, bytes 38 to 45
        std::ifstream file(path, std::ios::binary);
        std::int32_t metre[2] = {};
        file.seekg(38).read(reinterpret_cast<char*>(metre), sizeof metre);
        EXPECT_EQ(metre[0], 47244);
        EXPECT_EQ(metre[1], 23622);
        continue;
      }
      EXPECT_NEAR(dpi[0], 1200, 0.02);
      EXPECT_NEAR(dpi[1], 600, 0.02);
    }
  }
}

TEST(OpenImageIO, ReadsThePagesOfAJobLikeTheFilesInThem) {
  const testing::Folder folder;
  for (const bool big : {false, true}) {
    const std::string path = folder / "layers.tif";
    std::vector<std::string> singles;
    {
      auto file = File::open(path, {.replace = true});
      ASSERT_TRUE(file.ok());
      tiff::PageWriter writer(*file, big);
      for (const ImageFormat* format : testing::file_formats()) {
        if (format->extension != ".tif") continue;
        const Bytes bytes = testing::encoded(*format, testing::random_image(1000, 1000, 60), 1200, 600);
        const auto single = std::as_bytes(std::span(bytes));
        singles.push_back(folder / (std::to_string(singles.size()) + ".tif"));
        testing::save(singles.back(), bytes);
        ASSERT_TRUE(writer.add({"layers/" + std::to_string(singles.size()) + ".tif", {}, single.size()}, single).ok());
      }
      ASSERT_TRUE(writer.finish().ok() && file->finish().ok());
    }
    const auto pages = OIIO::ImageInput::open(path);
    ASSERT_TRUE(pages) << OIIO::geterror();
    for (std::size_t i = 0; i < singles.size(); ++i) {
      const auto single = OIIO::ImageInput::open(singles[i]);
      ASSERT_TRUE(single && pages->seek_subimage(static_cast<int>(i), 0)) << pages->geterror();
      std::vector<std::uint8_t> expected(single->spec().image_pixels()), found(pages->spec().image_pixels());
      ASSERT_TRUE(single->read_image(0, 0, 0, 1, OIIO::TypeDesc::UINT8, expected.data()));
      ASSERT_TRUE(pages->read_image(static_cast<int>(i), 0, 0, 1, OIIO::TypeDesc::UINT8, found.data())) << pages->geterror();
      EXPECT_TRUE(found == expected) << "page " << i;
    }
    EXPECT_FALSE(pages->seek_subimage(static_cast<int>(singles.size()), 0)) << "no more pages";
  }
}

// Level l of 15 is l seventeenths of 255 away from white, regardless of the file's own scale.
TEST(OpenImageIO, SeesLevelsAsGreyInEveryFormatThatCarriesThem) {
  const testing::Folder folder;
  for (const std::uint32_t columns : {1u, 8u, 63u, 1001u}) {
    std::mt19937 random(columns);
    Levels levels;
    std::vector<std::uint8_t> expected(std::size_t{columns} * 30, 255);
    levels.start(columns);
    for (std::uint32_t r = 0; r < 30; ++r) {
      for (std::uint32_t c = 0; c < columns; ++c) {
        const auto level = static_cast<std::uint8_t>(random() % 16);
        levels.append(c, c + 1, level);
        expected[std::size_t{columns} * r + c] = static_cast<std::uint8_t>(255 - 17 * level);
      }
      levels.end_row();
    }
    Runs size;
    threshold_levels(levels, 1, size);
    for (const LevelFormat& format : level_formats()) {
      SCOPED_TRACE(std::string(format.id) + ", " + std::to_string(columns) + " columns");
      const std::string path = folder / ("grey" + std::string(format.extension));
      Bytes file;
      ASSERT_TRUE(format.make_encoder()->encode(levels, 15, 1200, 600, file).ok());
      testing::save(path, file);
      double dpi[2] = {};
      ASSERT_EQ(pixels_by_openimageio(path, size, dpi), expected);
      EXPECT_NEAR(dpi[0], 1200, 0.02);
      EXPECT_NEAR(dpi[1], 600, 0.02);
    }
  }
}

}  // namespace
}  // namespace lamina::formats
