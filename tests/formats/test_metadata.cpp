// What a file says of itself, read by the formats' own libraries, and golden bytes.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <png.h>
#include <tiffio.h>

#include <cstdlib>

#include "stages/formats/images/image.h"
#include "stages/formats/png/png_format.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

/// 20 x 4 pixels, every polarity and bit order visible: a run from column 0, one to the last column, one across bytes,
/// a single pixel, a row like the one above, an empty row.
Runs small_image() { return testing::image_of(20, {{0, 3, 6, 13, 18, 20}, {0, 3, 6, 13, 18, 20}, {}, {9, 10}}); }

std::string text_of(const Bytes& bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

TEST(TiffTags, SayOneBitMinIsWhiteTopLeftAndTheResolutionInDpi) {
  const testing::Folder folder;
  const struct {
    const char* id;
    std::uint16_t compression;
  } cases[] = {{"tiff-g4", COMPRESSION_CCITTFAX4},
               {"tiff-deflate", COMPRESSION_ADOBE_DEFLATE},
               {"tiff-packbits", COMPRESSION_PACKBITS},
               {"tiff-none", COMPRESSION_NONE}};
  for (const auto& [id, compression] : cases) {
    SCOPED_TRACE(id);
    const std::string path = folder / "tags.tif";
    testing::save(path, testing::encoded(*find_image_format(id), small_image(), 1200, 600));
    TIFF* tiff = TIFFOpen(path.c_str(), "r");
    ASSERT_NE(tiff, nullptr);
    const auto short_tag = [&](std::uint32_t tag) {
      std::uint16_t value = 0xFFFF;
      TIFFGetField(tiff, tag, &value);
      return value;
    };
    std::uint32_t width = 0, length = 0;
    float resolution_x = 0, resolution_y = 0;
    char* software = nullptr;
    TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &width);
    TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &length);
    TIFFGetField(tiff, TIFFTAG_XRESOLUTION, &resolution_x);
    TIFFGetField(tiff, TIFFTAG_YRESOLUTION, &resolution_y);
    TIFFGetField(tiff, TIFFTAG_SOFTWARE, &software);
    EXPECT_EQ(width, 20u);
    EXPECT_EQ(length, 4u);
    EXPECT_EQ(resolution_x, 1200);
    EXPECT_EQ(resolution_y, 600);
    EXPECT_STREQ(software, "lamina");
    EXPECT_EQ(short_tag(TIFFTAG_BITSPERSAMPLE), 1);
    EXPECT_EQ(short_tag(TIFFTAG_SAMPLESPERPIXEL), 1);
    EXPECT_EQ(short_tag(TIFFTAG_COMPRESSION), compression);
    EXPECT_EQ(short_tag(TIFFTAG_PHOTOMETRIC), PHOTOMETRIC_MINISWHITE);
    EXPECT_EQ(short_tag(TIFFTAG_FILLORDER), FILLORDER_MSB2LSB);
    EXPECT_EQ(short_tag(TIFFTAG_ORIENTATION), ORIENTATION_TOPLEFT);
    EXPECT_EQ(short_tag(TIFFTAG_RESOLUTIONUNIT), RESUNIT_INCH);
    EXPECT_EQ(short_tag(TIFFTAG_PLANARCONFIG), PLANARCONFIG_CONTIG);
    std::uint8_t row[3] = {};
    ASSERT_EQ(TIFFReadScanline(tiff, row, 0, 0), 1);
    EXPECT_EQ(row[0], 0b11100011);  // a set bit is a set pixel, the leftmost pixel in the highest bit
    EXPECT_EQ(row[1], 0b11111000);
    EXPECT_EQ(row[2], 0b00110000);
    TIFFClose(tiff);
  }
}

/// The description, the page and the first strip of a file; "" and -1 where tags are absent.
struct LayerTagsRead {
  std::string description, strip;
  int page = -1, pages = -1;

  explicit LayerTagsRead(const std::string& path) {
    TIFF* tiff = TIFFOpen(path.c_str(), "r");
    if (tiff == nullptr) return;
    const char* text = nullptr;
    if (TIFFGetField(tiff, TIFFTAG_IMAGEDESCRIPTION, &text) == 1) description = text;
    std::uint16_t number = 0, of = 0;
    if (TIFFGetField(tiff, TIFFTAG_PAGENUMBER, &number, &of) == 1) page = number, pages = of;
    strip.resize(static_cast<std::size_t>(TIFFRawStripSize64(tiff, 0)));
    EXPECT_EQ(TIFFReadRawStrip(tiff, 0, strip.data(), static_cast<tmsize_t>(strip.size())),
              static_cast<tmsize_t>(strip.size()));
    TIFFClose(tiff);
  }
};

TEST(TiffTags, ReportJobLayerAndHeightAndLeaveThePixelsAsTheyAre) {
  const testing::Folder folder;
  const std::string path = folder / "tags.tif";
  for (const char* id : {"tiff-g4", "tiff-deflate", "tiff-packbits", "tiff-none"}) {
    SCOPED_TRACE(id);
    const auto encoder = find_image_format(id)->make_encoder();
    const auto read = [&] {
      Bytes file;
      EXPECT_TRUE(encoder->encode(small_image(), 1200, 600, file).ok());
      testing::save(path, file);
      return LayerTagsRead(path);
    };
    const LayerTagsRead bare = read();
    EXPECT_EQ(bare.description, "");
    EXPECT_EQ(bare.page, -1);
    encoder->tag({"order 4711", {}, {}, 11, 120, 550'000, 600'000});
    const LayerTagsRead reported = read();
    EXPECT_EQ(reported.description, "order 4711, layer 12 of 120, z 0.55 to 0.6 mm");
    EXPECT_EQ(reported.page, 11);
    EXPECT_EQ(reported.pages, 120);
    EXPECT_EQ(reported.strip, bare.strip);
    encoder->tag({"K\xc3\xb6rper\n" + std::string(500, 'x'), "steel", "xy", 69'999, 70'000, 0, 1});
    const LayerTagsRead odd = read();
    EXPECT_TRUE(odd.description.starts_with("K??rper?x")) << odd.description;
    EXPECT_TRUE(odd.description.ends_with("x, layer 70000 of 70000, z 0 to 0.000001 mm, steel, mirrored in xy"))
        << odd.description;
    EXPECT_EQ(odd.page, -1) << "beyond 16 bits";
    EXPECT_EQ(odd.strip, bare.strip);
  }
}

TEST(TiffStrips, HoldNoMoreThanAQuarterMegabyteUnlessARowIsLonger) {
  const testing::Folder folder;
  const std::string path = folder / "strips.tif";
  for (const std::uint32_t columns : {8000u, 18898u, 2'100'000u}) {
    const Runs runs = testing::image_of(columns, std::vector<testing::Row>(700, {1, columns - 1}));
    testing::save(path, testing::encoded(*find_image_format("tiff-none"), runs));
    TIFF* tiff = TIFFOpen(path.c_str(), "r");
    ASSERT_NE(tiff, nullptr);
    EXPECT_LE(TIFFStripSize(tiff), std::max<tmsize_t>(256 * 1024, (columns + 7) / 8));
    EXPECT_GE(TIFFStripSize(tiff), 128 * 1024);
    TIFFClose(tiff);
  }
}

TEST(PngChunks, SayOneBitPaletteBlackForSetPixelsAndPixelsAMetre) {
  const Bytes file = testing::encoded(*find_image_format("png"), small_image(), 1200, 600);
  const std::string text = text_of(file);
  // IHDR: 20 x 4, depth 1, colour type 3, deflate, adaptive filters, not interlaced.
  EXPECT_EQ(text.substr(12, 17), std::string("IHDR\0\0\0\x14\0\0\0\x04\x01\x03\0\0\0", 17));
  const std::size_t palette = text.find("PLTE");
  ASSERT_NE(palette, std::string::npos);
  EXPECT_EQ(text.substr(palette + 4, 6), std::string("\xFF\xFF\xFF\0\0\0", 6));
  const std::size_t physical = text.find("pHYs");
  ASSERT_NE(physical, std::string::npos);
  // 1200 / 0.0254 = 47244.09, 600 / 0.0254 = 23622.05, unit metre.
  EXPECT_EQ(text.substr(physical + 4, 9), std::string("\0\0\xB8\x8C\0\0\x5C\x46\x01", 9));
}

TEST(Png, LibpngsOwnReaderSeesBlackWhereRunsAre) {
  const Bytes file = testing::encoded(*find_image_format("png"), small_image());
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_memory(&image, file.data(), file.size()), 0);
  image.format = PNG_FORMAT_GRAY;
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
  ASSERT_NE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr), 0);
  const std::string expected = "###...#######.....##";
  for (std::size_t column = 0; column < 20; ++column) EXPECT_EQ(pixels[column], expected[column] == '#' ? 0 : 255);
}

TEST(Png, LibpngsOwnReaderSeesEveryColourOfAPalette) {
  std::vector<std::string> colours;
  for (int i = 0; i < 256; ++i) colours.push_back(fmt::format("{:02x}{:02x}{:02x}", i, 255 - i, i / 2));
  std::vector<std::uint8_t> pixels(300 * 7);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(i * i / 5 % 256);
  const Bytes file = png::coloured(300, colours, pixels);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_memory(&image, file.data(), file.size()), 0);
  ASSERT_EQ(image.width, 300u);
  ASSERT_EQ(image.height, 7u);
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> read(PNG_IMAGE_SIZE(image));
  ASSERT_NE(png_image_finish_read(&image, nullptr, read.data(), 0, nullptr), 0) << image.message;
  for (std::size_t i = 0; i < pixels.size(); ++i)
    ASSERT_EQ(fmt::format("{:02x}{:02x}{:02x}", read[3 * i], read[3 * i + 1], read[3 * i + 2]), colours[pixels[i]]) << i;
}

TEST(Pbm, IsAHeaderWithTheDpiAndPackedRows) {
  const std::string text = text_of(testing::encoded(*find_image_format("pbm"), small_image(), 1200, 600));
  EXPECT_EQ(text, std::string("P4\n# lamina dpi 1200 600\n20 4\n") + std::string("\xE3\xF8\x30\xE3\xF8\x30\0\0\0\0\x40\0", 12));
}

TEST(Pbm, OtherWritersHeadersAreRead) {
  const testing::Folder folder;
  const std::string path = folder / "other.pbm";
  for (const std::string& head : {std::string("P4 8 1\n"), std::string("P4#x\n#y\r\n 8 #z\n\t1 "), std::string("P4\n8\n1\n")}) {
    const std::string text = head + "\x3C";
    testing::save(path, std::as_bytes(std::span(text)));
    const auto image = formats::image(path);
    ASSERT_TRUE(image.ok()) << head << ": " << image.error().message;
    EXPECT_EQ(image->dpi_x, 0);
    ASSERT_EQ(image->runs.change.size(), 2u);
    EXPECT_EQ(image->runs.change[0], 2u);
    EXPECT_EQ(image->runs.change[1], 6u);
  }
}

TEST(Null, WritesNothing) {
  const ImageFormat* format = find_image_format("null");
  Bytes file(7);
  EXPECT_TRUE(format->make_encoder()->encode(small_image(), 600, 600, file).ok());
  EXPECT_TRUE(file.empty());
}

// The files of tests/golden/write hold small_image() in each format at 1200 x 600 dpi. They change only if a format
// changes on purpose (or if libtiff orders its directory anew): set LAMINA_WRITE_GOLDEN to write
// them again, inspect the difference, and say so in CHANGELOG.md, because finished jobs cannot be resumed across it.
// small.tiff-g4.tif holds from offset 8:
//   row 0  001 00110101 10    horizontal: white 0, black 3
//          001 1000 00011     horizontal: white 3, black 7
//          000010             two to the left of the change above, which is the end of the empty row
//          1                  the end of the row, as above
//   row 1  1 1 1 1 1 1        six changes as above; the last one is the end of the row
//   row 2  0001 0001          two passes over runs above; the third one ends with the row, so it cannot be passed:
//          000011             the end of the row, two to the right of where the third run begins
//   row 3  001 10100 010      horizontal: white 9, black 1
//          1                  the end of the row, as above
//          000000000001 000000000001, zeros up to the byte, and the directory of 15 tags at an even offset.
TEST(Golden, EachFormatWritesTheBytesThatItAlwaysWrote) {
  for (const ImageFormat* format : testing::file_formats()) {
    const Bytes file = testing::encoded(*format, small_image(), 1200, 600);
    const std::string path =
        std::string(LAMINA_TEST_DIR) + "/golden/write/small." + std::string(format->id) + std::string(format->extension);
    if (std::getenv("LAMINA_WRITE_GOLDEN") != nullptr) testing::save(path, file);
    EXPECT_EQ(text_of(file), testing::load(path)) << path;
  }
}

TEST(Golden, TheG4CodeWordsAreThoseFoundByHand) {
  const std::string words =
      "001"
      "00110101"
      "10"
      "001"
      "1000"
      "00011"
      "000010"
      "1"
      "111111"
      "0001"
      "0001"
      "000011"
      "001"
      "10100"
      "010"
      "1"
      "000000000001"
      "000000000001";
  const std::string file = text_of(testing::encoded(*find_image_format("tiff-g4"), small_image()));
  std::string bits;
  for (std::size_t i = 0; i < (words.size() + 7) / 8; ++i) {
    for (int bit = 7; bit >= 0; --bit) bits += (static_cast<unsigned char>(file[8 + i]) >> bit & 1) != 0 ? '1' : '0';
  }
  EXPECT_EQ(bits.substr(0, words.size()), words);
  EXPECT_EQ(bits.find('1', words.size()), std::string::npos);
}

}  // namespace
}  // namespace lamina::formats
