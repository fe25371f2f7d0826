// Reading what is not whole: always an error, never a crash, never a wait.
#include <gtest/gtest.h>

#include "stages/formats/images/image.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

TEST(ReadImage, AFileCutOffAtAnyLengthIsAnErrorInOneLine) {
  const testing::Folder folder;
  for (const ImageFormat* format : testing::file_formats()) {
    const Bytes file = testing::encoded(*format, testing::random_image(5, 90, 30));
    const std::string path = folder / ("cut" + std::string(format->extension));
    for (std::size_t length = 0; length < file.size(); ++length) {
      testing::save(path, std::span(file).first(length));
      const auto image = formats::image(path);
      ASSERT_FALSE(image.ok()) << format->id << " cut off after " << length << " of " << file.size();
      EXPECT_EQ(image.error().fault, Fault::kVerification);
      EXPECT_EQ(image.error().message.find(path), 0u) << image.error().message;
      EXPECT_EQ(image.error().message.find('\n'), std::string::npos) << image.error().message;
    }
  }
}

/// Reads damaged copies of a file. That an image comes out is allowed where the damage makes another image; then it
/// must be a well-formed one.
void expect_survival(const ImageFormat& format, const Bytes& file, std::uint32_t seed, int rounds) {
  const testing::Folder folder;
  const std::string path = folder / ("damaged" + std::string(format.extension));
  std::mt19937 random(seed);
  for (int round = 0; round < rounds; ++round) {
    Bytes damaged = file;
    const std::uint32_t damages = 1 + testing::below(random, 4);
    for (std::uint32_t i = 0; i < damages; ++i) {
      const std::uint32_t at = testing::below(random, static_cast<std::uint32_t>(damaged.size()));
      switch (testing::below(random, 5)) {
        case 0: damaged[at] = std::byte{0xFF}; break;
        case 1: damaged[at] = std::byte{0}; break;
        case 2: damaged[at] ^= std::byte(1u << testing::below(random, 8)); break;
        case 3: damaged[at] = std::byte(random() & 0xFF); break;
        default: damaged.erase(damaged.begin() + at); break;
      }
    }
    testing::save(path, damaged);
    const auto image = formats::image(path);
    if (!image.ok()) {
      ASSERT_EQ(image.error().message.find('\n'), std::string::npos) << image.error().message;
      continue;
    }
    const RunsView runs = image->runs;
    ASSERT_EQ(runs.row_offset.front(), 0u);
    ASSERT_EQ(runs.row_offset.back(), runs.change.size());
    for (std::uint32_t r = 0; r < runs.rows(); ++r) {
      const auto row = runs.row(r);
      ASSERT_EQ(row.size() % 2, 0u);
      ASSERT_TRUE(std::is_sorted(row.begin(), row.end(), std::less_equal<>())) << "row " << r;
      if (!row.empty()) {
        ASSERT_LE(row.back(), runs.columns);
      }
    }
  }
}

TEST(ReadImage, ThousandsOfDamagedFilesNeverCrash) {
  for (const ImageFormat* format : testing::file_formats()) {
    SCOPED_TRACE(std::string(format->id));
    expect_survival(*format, testing::encoded(*format, testing::random_image(7, 33, 12)), 1, 2000);
    expect_survival(*format, testing::encoded(*format, testing::random_image(8, 700, 30)), 2, 700);
  }
}

TEST(ReadImage, DamageInTheHeadersOnlyNeverCrashes) {
  for (const ImageFormat* format : testing::file_formats()) {
    SCOPED_TRACE(std::string(format->id));
    // A tiny image: nearly all of the file is headers.
    expect_survival(*format, testing::encoded(*format, testing::image_of(9, {{1, 5}, {}})), 3, 2500);
  }
}

/// Replaces the four bytes of a little-endian value at `at`.
void put_long(Bytes& file, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i) file[at + i] = std::byte(value >> (8 * i) & 0xFF);
}

/// Where the value of a tag lies in the directory of a little-endian TIFF.
std::size_t value_of_tag(const Bytes& file, std::uint32_t tag) {
  const auto number = [&](std::size_t at, std::size_t bytes) {
    std::size_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i) value |= std::to_integer<std::size_t>(file[at + i]) << (8 * i);
    return value;
  };
  const std::size_t directory = number(4, 4);
  for (std::size_t i = 0; i < number(directory, 2); ++i) {
    if (number(directory + 2 + 12 * i, 2) == tag) return directory + 2 + 12 * i + 8;
  }
  return 0;
}

TEST(ReadImage, ATiffThatPromisesMorePixelsThanItsBytesCanHoldIsRefusedAtOnce) {
  const testing::Folder folder;
  const std::string path = folder / "liar.tif";
  for (const char* id : {"tiff-g4", "tiff-deflate", "tiff-packbits", "tiff-none"}) {
    for (const std::uint32_t rows : {100'000u, 2'000'000u, 0x7FFFFFFFu, 0xFFFFFFFFu}) {
      Bytes file = testing::encoded(*find_image_format(id), testing::image_of(9, {{1, 5}, {}}));
      const std::size_t length = value_of_tag(file, 257), rows_per_strip = value_of_tag(file, 278);
      ASSERT_NE(length, 0u);
      put_long(file, length - 4, 1);
      put_long(file, length, rows);
      file[length - 6] = std::byte{4};  // LONG
      file[rows_per_strip - 6] = std::byte{4};
      put_long(file, rows_per_strip, rows);
      testing::save(path, file);
      EXPECT_FALSE(formats::image(path).ok()) << id << " " << rows;
    }
  }
}

TEST(ReadImage, HeadersThatPromiseTooMuchAreRefusedAtOnce) {
  const testing::Folder folder;
  const std::string pbm = folder / "liar.pbm", png = folder / "liar.png";
  for (const std::string& text :
       {std::string("P4\n2000000 2000000\nx"), std::string("P4\n4294967297 1\nx"), std::string("P4\n99999999999999999999 1\nx"),
        std::string("P4\n0 1\nx"), std::string("P4\n1 0\n"), std::string("P4\n-8 1\nx"), std::string("P4\n8 1\nxy"),
        std::string("P4#"), std::string("P4\n8 1"), std::string("P1\n1 1\n1")}) {
    testing::save(pbm, std::as_bytes(std::span(text)));
    EXPECT_FALSE(formats::image(pbm).ok()) << text;
  }
  // A whole PNG of 2,000,000 x 2,000,000 white pixels cannot be this short; CRC of this IHDR computed for the test.
  Bytes file = testing::encoded(*find_image_format("png"), testing::image_of(9, {{1, 5}, {}}));
  const std::uint8_t width[4] = {0x00, 0x1E, 0x84, 0x80}, sum[4] = {0, 0, 0, 0};
  for (std::size_t i = 0; i < 4; ++i) {
    file[16 + i] = file[20 + i] = std::byte{width[i]};
    file[29 + i] = std::byte{sum[i]};
  }
  testing::save(png, file);
  EXPECT_FALSE(formats::image(png).ok());
}

TEST(ReadImage, WhatIsNoImageIsAnError) {
  const testing::Folder folder;
  const std::string text = folder / "text.tif", none = folder / "none.tif";
  const std::string words = "not an image at all";
  testing::save(text, std::as_bytes(std::span(words)));
  EXPECT_FALSE(formats::image(text).ok());
  EXPECT_FALSE(formats::image(none).ok());
  EXPECT_FALSE(formats::image(folder / ".").ok());
  EXPECT_FALSE(formats::image("/dev/zero").ok());
}

}  // namespace
}  // namespace lamina::formats
