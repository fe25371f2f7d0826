// Grey images of others as levels and as dark pixels, by hand and with every way to write the same picture.
#include <gtest/gtest.h>

#include <png.h>
#include <tiffio.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "stages/formats/images/image.h"
#include "stages/formats/images/layer_images.h"
#include "stages/formats/images/placed.h"
#include "stages/formats/images/stack_info.h"
#include "stages/geometry/combine.h"
#include "tests/commands/program.h"

namespace lamina::formats {
namespace {

using Pixels = std::vector<std::vector<unsigned>>;

Pixels pixels_of(const LevelsView& image) {
  Pixels pixels(image.rows(), std::vector<unsigned>(image.columns));
  for (std::uint32_t r = 0; r < image.rows(); ++r) {
    for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i)
      for (std::uint32_t c = image.change[2 * i]; c < image.change[2 * i + 1]; ++c) pixels[r][c] = image.level[i];
  }
  return pixels;
}
Pixels pixels_of(const RunsView& image) {
  Levels levels;
  levels_of(image, 1, levels);
  return pixels_of(levels.view());
}

Levels levels_from(const Pixels& pixels) {
  Levels levels;
  levels.start(static_cast<std::uint32_t>(pixels.front().size()));
  for (const auto& row : pixels) {
    for (std::uint32_t c = 0; c < row.size(); ++c) levels.append(c, c + 1, static_cast<std::uint8_t>(row[c]));
    levels.end_row();
  }
  return levels;
}

/// Bits of values one after the other, the highest first, each row from a whole byte on.
std::vector<std::uint8_t> packed(const std::vector<unsigned>& row, unsigned bits) {
  std::vector<std::uint8_t> bytes((row.size() * bits + 7) / 8);
  for (std::size_t c = 0; c < row.size(); ++c) {
    for (unsigned b = 0; b < bits; ++b) {
      const std::size_t at = c * bits + b;
      if (row[c] >> (bits - 1 - b) & 1) bytes[at / 8] |= static_cast<std::uint8_t>(0x80 >> at % 8);
    }
  }
  return bytes;
}

void write_tiff(const std::string& path, const Pixels& values, unsigned bits, bool white_is_0) {
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  ASSERT_NE(tiff, nullptr);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(values.front().size()));
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(values.size()));
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, bits);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, white_is_0 ? PHOTOMETRIC_MINISWHITE : PHOTOMETRIC_MINISBLACK);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_LZW);
  TIFFSetField(tiff, TIFFTAG_XRESOLUTION, 300.0);
  TIFFSetField(tiff, TIFFTAG_YRESOLUTION, 200.0);
  for (std::uint32_t r = 0; r < values.size(); ++r) {
    std::vector<unsigned> row = values[r];
    for (unsigned& value : row) value = white_is_0 ? (1u << bits) - 1 - value : value;
    auto bytes = packed(row, bits);
    if (bits == 16)
      for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) std::swap(bytes[i], bytes[i + 1]);  // of this host
    TIFFWriteScanline(tiff, bytes.data(), r, 0);
  }
  TIFFClose(tiff);
}

void write_png(const std::string& path, const Pixels& values, unsigned bits) {
  FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_IHDR(png, info, static_cast<png_uint_32>(values.front().size()), static_cast<png_uint_32>(values.size()),
               static_cast<int>(bits), PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  for (const auto& row : values) {
    auto bytes = packed(row, bits);
    png_write_row(png, bytes.data());
  }
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

void write_pgm(const std::string& path, const Pixels& values) {
  std::ofstream file(path, std::ios::binary);
  file << "P5 " << values.front().size() << " " << values.size() << " 255\n";
  for (const auto& row : values)
    for (const unsigned value : row) file.put(static_cast<char>(value));
}

/// Rows from the bottom, colours of a palette that goes from white to black.
void write_bmp(const std::string& path, const Pixels& values) {
  const auto columns = static_cast<std::uint32_t>(values.front().size()), rows = static_cast<std::uint32_t>(values.size());
  std::string out = "BM";
  const auto put = [&](std::uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i));
  };
  const std::uint32_t begin = 14 + 40 + 1024, stride = (columns + 3) / 4 * 4;
  put(begin + stride * rows, 4), put(0, 4), put(begin, 4), put(40, 4), put(columns, 4), put(rows, 4), put(1, 2), put(8, 2);
  for (int i = 0; i < 6; ++i) put(0, 4);
  for (std::uint32_t c = 0; c < 256; ++c) put((255 - c) * 0x010101u, 4);
  for (std::size_t r = rows; r-- > 0;) {
    for (std::uint32_t c = 0; c < stride; ++c) out += static_cast<char>(c < columns ? 255 - values[r][c] : 0);
  }
  std::ofstream(path, std::ios::binary) << out;
}

Pixels levels_read(const std::string& path, std::uint8_t full, bool invert = false) {
  Levels levels;
  const auto image = nearest_levels(path, {full, invert}, levels);
  EXPECT_TRUE(image.ok()) << path << (image ? "" : image.error().message);
  return image ? pixels_of(levels.view()) : Pixels();
}

// (255 - v) n / 255 by hand, to the nearest whole number.
TEST(GreyImages, BecomeTheNearestLevel) {
  test::Directory folder;
  write_pgm(folder / "a1.pgm", {{0, 8, 9, 127, 128, 246, 247, 255}});
  EXPECT_EQ(levels_read(folder / "a1.pgm", 15), (Pixels{{15, 15, 14, 8, 7, 1, 0, 0}}));
  EXPECT_EQ(levels_read(folder / "a1.pgm", 3), (Pixels{{3, 3, 3, 2, 1, 0, 0, 0}}));
  EXPECT_EQ(levels_read(folder / "a1.pgm", 1), (Pixels{{1, 1, 1, 1, 0, 0, 0, 0}}));
  EXPECT_EQ(levels_read(folder / "a1.pgm", 255), (Pixels{{255, 247, 246, 128, 127, 9, 8, 0}}));
  EXPECT_EQ(levels_read(folder / "a1.pgm", 15, true), (Pixels{{0, 0, 1, 7, 8, 14, 15, 15}}));
  // Of 16 bits 32767.5 is the middle; 2184 and 2185 lie on both sides of half a level of 15 below black.
  write_tiff(folder / "a2.tif", {{0, 2184, 2185, 32767, 32768, 65535}}, 16, false);
  EXPECT_EQ(levels_read(folder / "a2.tif", 15), (Pixels{{15, 15, 14, 8, 7, 0}}));
  EXPECT_EQ(levels_read(folder / "a2.tif", 1), (Pixels{{1, 1, 1, 1, 0, 0}}));
}

TEST(GreyImages, SayTheSameInEveryFormatAndPhotometric) {
  test::Directory folder;
  std::mt19937 random(11);
  for (const unsigned bits : {2u, 4u, 8u, 16u}) {
    Pixels values(7, std::vector<unsigned>(23));
    for (auto& row : values)
      for (unsigned& value : row) value = random() % 4 == 0 ? 0 : static_cast<unsigned>(random() % (1u << bits));
    std::vector<std::string> files{"p.png"};
    write_png(folder / "p.png", values, bits);
    if (bits > 2) {
      write_tiff(folder / "black.tif", values, bits, false);
      write_tiff(folder / "white.tif", values, bits, true);
      files.insert(files.end(), {"black.tif", "white.tif"});
    }
    if (bits == 8) {
      write_pgm(folder / "p.pgm", values);
      write_bmp(folder / "p.bmp", values);
      files.insert(files.end(), {"p.pgm", "p.bmp"});
    }
    const unsigned darkest = (1u << bits) - 1;
    for (const auto full : std::initializer_list<std::uint8_t>{1, 3, 15, 255}) {
      Pixels expected = values;
      for (auto& row : expected)  // in rationals: the nearest of l / full, the higher one of two
        for (unsigned& value : row) {
          unsigned best = 0;
          const auto off = [&](unsigned level) {
            return std::abs(std::int64_t{level} * darkest - std::int64_t{darkest - value} * full);
          };
          for (unsigned level = 1; level <= full; ++level)
            if (off(level) <= off(best)) best = level;
          value = best;
        }
      for (const std::string& file : files) EXPECT_EQ(levels_read(folder / file, full), expected) << file << " " << bits;
    }
    for (const int threshold : {1, 100, 128, 255}) {
      Pixels expected = values;
      for (auto& row : expected)
        for (unsigned& value : row)
          value = (bits == 16 ? value >> 8 : value * 255 / darkest) < static_cast<unsigned>(threshold);
      for (const std::string& file : files) {
        const auto dark = dark_pixels(folder / file, threshold);
        ASSERT_TRUE(dark.ok()) << dark.error().message;
        EXPECT_EQ(pixels_of(dark->runs.view()), expected) << file << " " << bits << " below " << threshold;
      }
    }
  }
}

TEST(GreyImages, OfOneBitAreFullOrEmpty) {
  test::Directory folder;
  const Pixels bits{{0, 1, 1, 0, 0, 1, 0, 0, 1}, {1, 1, 1, 1, 1, 1, 1, 1, 1}, {0, 0, 0, 0, 0, 0, 0, 0, 0}};
  write_tiff(folder / "white.tif", bits, 1, true);
  write_png(folder / "p.png", bits, 1);
  Pixels dark = bits, light = bits;
  for (std::size_t r = 0; r < bits.size(); ++r)
    for (std::size_t c = 0; c < bits[r].size(); ++c) dark[r][c] = bits[r][c] ? 0 : 15, light[r][c] = bits[r][c] ? 15 : 0;
  for (const char* file : {"white.tif", "p.png"}) {
    EXPECT_EQ(levels_read(folder / file, 15), dark) << file;
    EXPECT_EQ(levels_read(folder / file, 15, true), light) << file;
  }
}

TEST(GreyImages, ArePlacedAndMergedPixelByPixel) {
  std::mt19937 random(5);
  const auto picture = [&](std::uint32_t columns, std::uint32_t rows) {
    Pixels pixels(rows, std::vector<unsigned>(columns));
    for (auto& row : pixels)
      for (std::uint32_t c = 0; c < columns; ++c)
        row[c] = c > 0 && random() % 2 == 0 ? row[c - 1] : random() % 3 == 0 ? 0 : static_cast<unsigned>(random() % 16);
    return pixels;
  };
  for (int trial = 0; trial < 200; ++trial) {
    const Pixels a = picture(17, 5), b = picture(17, 5);
    Pixels maximum = a;
    std::uint64_t within = 0;
    for (std::size_t r = 0; r < 5; ++r)
      for (std::size_t c = 0; c < 17; ++c) maximum[r][c] = std::max(a[r][c], b[r][c]), within += b[r][c] > 0 ? a[r][c] : 0;
    const Levels first = levels_from(a), second = levels_from(b);
    Levels out;
    larger(first, second, out);
    EXPECT_EQ(pixels_of(out.view()), maximum);
    for (std::size_t i = 1; i < out.level.size(); ++i)  // joined where they touch
      EXPECT_FALSE(out.change[2 * i] == out.change[2 * i - 1] && out.level[i] == out.level[i - 1] && out.change[2 * i] > 0);
    Runs mask;
    threshold_levels(second, 1, mask);
    EXPECT_EQ(sum_of_levels(first, mask), within);
  }
  const Pixels image = picture(31, 23);
  for (const auto& [own, dots] : {std::pair{600, 600}, {300, 600}, {600, 250}}) {
    const PixelGrid grid{PixelAxis(dots, 2'000'000), PixelAxis(dots, 1'000'000)};
    Levels out;
    position(levels_from(image), placement_of(31, 23, {own}, {own}, grid, 4, 2), out);
    Pixels expected(grid.rows(), std::vector<unsigned>(grid.columns()));
    for (std::int64_t r = 0; r < grid.rows(); ++r)
      for (std::int64_t c = 0; c < grid.columns(); ++c) {
        const std::int64_t x = c - 4, y = std::int64_t{grid.rows()} - 1 - r - 2;
        const std::int64_t from = (2 * x + 1) * own / (2 * dots), behind = (2 * y + 1) * own / (2 * dots);
        if (x >= 0 && y >= 0 && from < 31 && behind < 23)
          expected[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] =
              image[22 - static_cast<std::size_t>(behind)][static_cast<std::size_t>(from)];
      }
    EXPECT_EQ(pixels_of(out.view()), expected) << own << " " << dots;
  }
}

// Files that systems and people leave next to images, and names that are easily misread.
TEST(Stacks, OfOddFoldersAreReadRightOrRefusedInALine) {
  const auto open = [](const test::Directory& folder) { return LayerImages::open(folder.path().string(), {}); };
  const Pixels one{{0, 255}};
  {
    test::Directory folder;
    write_tiff(folder / "a2.TIFF", one, 8, false);
    write_pgm(folder / "A1.PGM", one);
    test::write_text(folder / "._a1.tif", "of another system");
    test::write_text(folder / ".DS_Store", "x");
    test::write_text(folder / "notes 7.txt", "x");
    const auto stack = open(folder);
    ASSERT_TRUE(stack.ok()) << stack.error().message;
    EXPECT_EQ(stack->layers(), 2u);
    EXPECT_EQ(stack->file(0), folder / "A1.PGM");
  }
  const auto refused = [&](const std::vector<std::string>& names, const std::string& words) {
    test::Directory folder;
    for (const std::string& name : names) {
      std::filesystem::create_directories((folder.path() / name).parent_path());
      write_pgm(folder / name, one);
    }
    const auto stack = open(folder);
    ASSERT_FALSE(stack.ok()) << words;
    EXPECT_NE(stack.error().message.find(words), std::string::npos) << stack.error().message;
  };
  refused({"a1.pgm", "a01.pgm"}, "a1.pgm: has the number of a01.pgm");
  refused({"a1.pgm", "a1.PGM"}, "has the number of");
  refused({"layers/a1.pgm", "more/a2.pgm"}, "layers");
  refused({"a1.pgm", "a2.jpg"}, "a2.jpg: is of a format that is not read");
  refused({"a1.pgm", "preview.pgm"}, "preview.pgm: has no layer number");
  {
    test::Directory folder;
    write_pgm(folder / "a1.pgm", one);
    std::filesystem::create_directory(folder / "a2.pgm");  // a folder is no image
    const auto stack = open(folder);
    ASSERT_TRUE(stack.ok()) << stack.error().message;
    EXPECT_EQ(stack->layers(), 1u);
  }
}

// The estimate before an image is read is near what it has, in every coding.
TEST(Stacks, ExpectAboutAsManyChangesAsImagesHave) {
  for (const char* kind : {"stripes", "empty", "blank"}) {
    test::Directory folder;
    std::uint64_t maximum = 0;
    for (int i = 1; i <= 9; ++i) {
      Pixels pixels(400, std::vector<unsigned>(800, 255));
      for (auto& row : pixels)
        for (std::size_t c = 0; c < row.size(); ++c)
          if (kind[0] == 's' && c % 4 < 2 && c < 80u * static_cast<unsigned>(i)) row[c] = 0;
      if (kind[0] == 'e' && i == 5) pixels[7][9] = 0;
      write_pgm(folder / ("a" + std::to_string(i) + ".pgm"), pixels);
    }
    const auto stack = LayerImages::open(folder.path().string(), {.inspections = 5});
    ASSERT_TRUE(stack.ok()) << stack.error().message;
    for (std::uint32_t l = 0; l < 9; ++l) {
      const std::uint64_t changes = stack->read(l)->change.size();
      EXPECT_GE(stack->expected_changes(l), changes) << kind << l;
      maximum = std::max(maximum, changes);
    }
    for (std::uint32_t l = 0; l < 9; ++l) EXPECT_LE(stack->expected_changes(l), 2 * maximum + 2) << kind << l;
  }
}

TEST(StackInfo, ReportsWhatAFolderHolds) {
  test::Directory folder;
  write_tiff(folder / "a3.tif", {{0, 0, 255, 128}}, 8, true);
  write_tiff(folder / "a4.tif", {{255, 255, 255, 255}}, 8, true);
  write_tiff(folder / "a8.tif", {{0, 255, 255, 255}}, 8, true);
  write_tiff(folder / "a9.tif", {{0, 255, 255}}, 8, true);
  test::write_text(folder / "a12.tif", "II*");
  const auto info = inspect_stack(folder.path().string(), 129);
  ASSERT_TRUE(info.ok()) << info.error().message;
  EXPECT_EQ(info->images, 5u);
  EXPECT_EQ(info->first_number, 3u);
  EXPECT_EQ(info->last_number, 12u);
  EXPECT_EQ(info->missing, (std::vector<std::array<std::uint64_t, 2>>{{5, 7}, {10, 11}}));
  EXPECT_EQ(info->missing_numbers(), 5u);
  EXPECT_EQ(info->columns, 4u);
  EXPECT_EQ(info->rows, 1u);
  EXPECT_EQ(info->dpi_x, 300);
  EXPECT_EQ(info->dpi_y, 200);
  EXPECT_EQ(info->kind.bits, 8u);
  EXPECT_EQ(info->kind.light, "0 is white");
  EXPECT_EQ(info->kind.coding, "LZW");
  EXPECT_EQ(info->set, 5u);  // 3, 0, 1, 1
  EXPECT_EQ(info->empty, 1u);
  EXPECT_EQ(info->grey, 1u);
  EXPECT_NEAR(info->filled, 4 + 127.0 / 255, 1e-9);
  EXPECT_EQ(info->differing, 1u);
  EXPECT_EQ(info->unreadable, 1u);
  ASSERT_EQ(info->wrong.size(), 2u);
  EXPECT_NE(info->wrong[0].find("a9.tif: 3 x 1 pixels"), std::string::npos) << info->wrong[0];
  EXPECT_NE(info->wrong[1].find("a12.tif"), std::string::npos) << info->wrong[1];
}

}  // namespace
}  // namespace lamina::formats
