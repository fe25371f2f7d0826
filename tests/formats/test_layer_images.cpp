// Stacks of layer images, and where their pixels come to lie.
#include "stages/formats/images/layer_images.h"

#include <gtest/gtest.h>

#include <tiffio.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>

#include "stages/formats/image_format.h"
#include "stages/formats/images/image.h"
#include "stages/formats/images/placed.h"
#include "stages/support/io/file.h"

namespace lamina::formats {
namespace {

namespace fs = std::filesystem;

class LayerImagesTest : public ::testing::Test {
 protected:
  LayerImagesTest() : folder_(fs::temp_directory_path() / ("lamina_layer_images_" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~LayerImagesTest() override { fs::remove_all(folder_); }

  static Runs square(std::uint32_t columns, std::uint32_t rows) {
    Runs runs;
    runs.columns = columns;
    runs.row_offset.push_back(0);
    for (std::uint32_t r = 0; r < rows; ++r) {
      if (r > 0) runs.change.insert(runs.change.end(), {r % 3, columns - 1});
      runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
    }
    return runs;
  }
  void save(const std::string& name, const Runs& runs, std::string_view format) {
    formats::Bytes bytes;
    ASSERT_TRUE(formats::find_image_format(format)->make_encoder()->encode(runs, 600, 300, bytes));
    ASSERT_TRUE(write_file((folder_ / name).string(), bytes));
  }

  fs::path folder_;
};

TEST_F(LayerImagesTest, ReadsEveryFormatThatIsWritten) {
  for (const auto& format : formats::image_formats()) {
    if (format.extension.empty()) continue;
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    save("a8" + std::string(format.extension), square(37, 9), format.id);
    save("a9" + std::string(format.extension), square(37, 9), format.id);
    save("a10" + std::string(format.extension), square(37, 9), format.id);
    const auto stack = LayerImages::open(folder_.string(), {});
    ASSERT_TRUE(stack.ok()) << stack.error().message;
    EXPECT_EQ(stack->layers(), 3u);
    EXPECT_NEAR(stack->dpi_x(), 600, 0.02);
    EXPECT_NEAR(stack->dpi_y(), 300, 0.02);
    const auto image = stack->read(2);
    ASSERT_TRUE(image.ok()) << image.error().message;
    EXPECT_TRUE(image->change == square(37, 9).change) << format.id;
  }
}

TEST_F(LayerImagesTest, NamesWhatIsMissingOrOfAnotherSize) {
  save("a1.bmp", square(8, 4), "bmp");
  save("a3.bmp", square(9, 4), "bmp");
  const auto gap = LayerImages::open(folder_.string(), {});
  ASSERT_FALSE(gap.ok());
  EXPECT_NE(gap.error().message.find("number 2 is missing"), std::string::npos) << gap.error().message;
  const auto stack = LayerImages::open(folder_.string(), {.missing_empty = true});
  ASSERT_TRUE(stack.ok()) << stack.error().message;
  EXPECT_EQ(stack->layers(), 3u);
  EXPECT_EQ(set_pixels(*stack->read(1)), 0u);
  const auto other = stack->read(2);
  ASSERT_FALSE(other.ok());
  EXPECT_NE(other.error().message.find("9 x 4 pixels, the first image has 8 x 4"), std::string::npos) << other.error().message;
}

// What is read is what was hashed when the job was planned.
TEST_F(LayerImagesTest, FilesThatChangeAfterTheyWereInspectedAreRefused) {
  save("a1.tif", square(20, 5), "tiff-g4");
  save("a2.tif", square(20, 5), "tiff-g4");
  const auto stack = LayerImages::open(folder_.string(), {});
  ASSERT_TRUE(stack.ok());
  ASSERT_TRUE(stack->read(1).ok());
  const auto before = fs::last_write_time(folder_ / "a2.tif");
  fs::last_write_time(folder_ / "a2.tif", before + std::chrono::seconds(2));
  const auto changed = stack->read(1);
  ASSERT_FALSE(changed.ok());
  EXPECT_NE(changed.error().message.find("was changed while the job ran"), std::string::npos) << changed.error().message;
  EXPECT_TRUE(stack->read(0).ok());
  fs::resize_file(folder_ / "a1.tif", fs::file_size(folder_ / "a1.tif") / 2);
  EXPECT_FALSE(stack->read(0).ok());
}

// A thumbnail next to a page is no layer.
TEST_F(LayerImagesTest, ReducedPagesAreNoLayers) {
  save("a1.tif", square(20, 5), "tiff-g4");
  const std::string path = (folder_ / "pages.tif").string();
  fs::rename(folder_ / "a1.tif", path);
  EXPECT_EQ(formats::pages_of(path)->size(), 1u);
  TIFF* tiff = TIFFOpen(path.c_str(), "a");
  ASSERT_NE(tiff, nullptr);
  TIFFSetField(tiff, TIFFTAG_SUBFILETYPE, FILETYPE_REDUCEDIMAGE);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 8);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 1);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 1);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE);
  unsigned char row = 0xff;
  TIFFWriteScanline(tiff, &row, 0, 0);
  TIFFClose(tiff);
  const auto pages = formats::pages_of(path);
  ASSERT_TRUE(pages.ok()) << pages.error().message;
  EXPECT_EQ(pages->size(), 1u);
}

TEST_F(LayerImagesTest, InvertedImageIsTheRest) {
  save("a1.png", square(20, 5), "png");
  const auto plain = LayerImages::open(folder_.string(), {}), turned = LayerImages::open(folder_.string(), {.invert = true});
  ASSERT_TRUE(plain.ok() && turned.ok());
  EXPECT_EQ(set_pixels(*plain->read(0)) + set_pixels(*turned->read(0)), 100u);
  EXPECT_NE(plain->fingerprint(), turned->fingerprint());
}

TEST(PlacedImage, TakesThePixelThatTheCentreLiesIn) {
  std::mt19937 random(3);
  for (const auto& [own_dpi, dpi] :
       {std::pair{600.0, 600.0}, {300, 600}, {600, 250}, {127, 600}, {540.43, 600}, {300, 262.006}}) {
    const PixelGrid grid{PixelAxis(pitch_of_dpi(dpi), 2'000'000), PixelAxis(pitch_of_dpi(dpi), 1'500'000)};
    const std::int64_t own = std::llround(own_dpi * 1000), dots = std::llround(dpi * 1000);
    Runs image;
    image.columns = 31;
    image.row_offset.push_back(0);
    std::vector<std::vector<bool>> set(23, std::vector<bool>(31));
    for (auto& row : set) {
      for (std::uint32_t c = 0; c < 31; ++c) row[c] = random() % 3 == 0;
      for (std::uint32_t c = 0; c <= 31; ++c)
        if ((c < 31 && row[c]) != (c > 0 && row[c - 1])) image.change.push_back(c);
      image.row_offset.push_back(static_cast<std::uint32_t>(image.change.size()));
    }
    Runs out;
    position(image, placement_of(31, 23, pitch_of_dpi(own_dpi), pitch_of_dpi(own_dpi), grid, 4, 2), out);
    ASSERT_EQ(out.row_offset.size(), grid.rows() + 1u);
    for (std::uint32_t r = 0; r < grid.rows(); ++r) {
      std::vector<bool> got(grid.columns());
      const auto row = out.view().row(r);
      for (std::size_t i = 0; i + 1 < row.size(); i += 2)
        for (std::uint32_t c = row[i]; c < row[i + 1]; ++c) got[c] = true;
      for (std::int64_t c = 0; c < grid.columns(); ++c) {
        const std::int64_t x = c - 4, y = std::int64_t{grid.rows()} - 1 - r - 2;
        const std::int64_t from = (2 * x + 1) * own / (2 * dots), behind = (2 * y + 1) * own / (2 * dots);
        const bool want = x >= 0 && y >= 0 && from < 31 && behind < 23 &&
                          set[22 - static_cast<std::size_t>(behind)][static_cast<std::size_t>(from)];
        ASSERT_EQ(got[static_cast<std::size_t>(c)], want) << own << " " << dots << " row " << r << " column " << c;
      }
    }
  }
}

}  // namespace
}  // namespace lamina::formats
