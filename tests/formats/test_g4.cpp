// The decoder of Group 4 against libtiff: what it takes is what libtiff decodes.
#include "stages/formats/g4/decode.h"

#include <gtest/gtest.h>
#include <tiffio.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "stages/formats/g4/encode.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/bits.h"

namespace lamina::formats {
namespace {

class G4Test : public ::testing::Test {
 protected:
  G4Test() : path_(std::filesystem::temp_directory_path() / ("lamina_g4_" + std::to_string(::getpid()) + ".tif")) {
    TIFFSetWarningHandler([](const char*, const char*, va_list) { ++complaints_; });
    TIFFSetErrorHandler([](const char*, const char*, va_list) { ++complaints_; });
  }
  ~G4Test() override { std::filesystem::remove(path_); }

  struct Tags {
    std::uint32_t columns, rows, rows_per_strip;
    std::uint16_t fill_order = FILLORDER_MSB2LSB, photometric = PHOTOMETRIC_MINISWHITE;
  };

  TIFF* create(const Tags& tags) const {
    TIFF* tiff = TIFFOpen(path_.c_str(), "w");
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, tags.columns);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, tags.rows);
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, tags.rows_per_strip);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 1);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_CCITTFAX4);
    TIFFSetField(tiff, TIFFTAG_FILLORDER, tags.fill_order);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, tags.photometric);
    return tiff;
  }
  /// libtiff codes the black pixels.
  void save(const Tags& tags, const Runs& black) const {
    TIFF* tiff = create(tags);
    Buffer<std::byte> row(row_bytes(tags.columns));
    for (std::uint32_t r = 0; r < tags.rows; ++r) {
      expand_row(black.view().row(r), row);
      ASSERT_EQ(TIFFWriteScanline(tiff, row.data(), r, 0), 1);
    }
    TIFFClose(tiff);
  }
  /// A strip of these bytes, whatever they are.
  void save_coded(const Tags& tags, std::vector<std::uint8_t> coded) const {
    TIFF* tiff = create(tags);
    ASSERT_GE(TIFFWriteRawStrip(tiff, 0, coded.data(), static_cast<tmsize_t>(coded.size())), 0);
    TIFFClose(tiff);
  }
  /// What libtiff decodes; nothing if it complains.
  std::optional<Runs> by_libtiff(const Tags& tags) const {
    complaints_ = 0;
    TIFF* tiff = TIFFOpen(path_.c_str(), "rC");
    if (tiff == nullptr) return {};
    RunsBuilder builder(tags.columns);
    Buffer<std::byte> row(row_bytes(tags.columns));
    bool whole = true;
    for (std::uint32_t r = 0; r < tags.rows && whole; ++r) {
      whole = TIFFReadScanline(tiff, row.data(), r, 0) == 1 && complaints_ == 0;
      builder.add_row(row, tags.photometric == PHOTOMETRIC_MINISBLACK);
    }
    TIFFClose(tiff);
    if (!whole) return {};
    return builder.finish();
  }
  static bool same(const Runs& a, const Runs& b) {
    return a.columns == b.columns && a.row_offset == b.row_offset && a.change == b.change;
  }

  std::filesystem::path path_;
  inline static int complaints_ = 0;
};

std::uint32_t pick(std::mt19937& random, std::uint32_t limit) { return static_cast<std::uint32_t>(random() % limit); }

/// Rows that follow each other's edges, rows that do not, blank ones, full ones and equal ones.
Runs mixed_image(std::mt19937& random, std::uint32_t columns, std::uint32_t rows) {
  Runs runs;
  runs.columns = columns;
  runs.row_offset.push_back(0);
  std::vector<std::uint32_t> row;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::uint32_t kind = pick(random, 8);
    if (kind == 0) row.clear();
    if (kind == 1) row = {0, columns};
    if (kind == 2 || kind == 3) {
      row.clear();
      const std::uint32_t spacing = 1 + pick(random, kind == 2 ? 12 : columns);
      for (std::uint32_t c = pick(random, spacing); c <= columns; c += 1 + pick(random, 2 * spacing)) row.push_back(c);
    }
    if (kind > 4) {
      for (std::uint32_t& c : row) c = std::clamp<std::uint32_t>(c + pick(random, kind == 5 ? 3 : 8), 1, columns + 1) - 1;
    }
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    if (row.size() % 2 != 0) row.pop_back();
    runs.change.insert(runs.change.end(), row.begin(), row.end());
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

TEST_F(G4Test, ImagesOfEveryWidthFillOrderStripAndPhotometricAreThoseOfLibtiff) {
  std::mt19937 random(3);
  for (std::uint32_t i = 0; i < 160; ++i) {
    const std::uint32_t columns = i < 70 ? i + 1 : i < 140 ? 64 * (i - 69) + i % 3 - 1 : 1 + pick(random, 30'000);
    Tags tags{columns, 40, i % 4 == 0 ? 7u : 40u};
    tags.fill_order = i % 3 == 1 ? FILLORDER_LSB2MSB : FILLORDER_MSB2LSB;
    tags.photometric = i % 5 < 2 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_MINISWHITE;
    save(tags, mixed_image(random, columns, tags.rows));
    const auto expected = by_libtiff(tags);
    ASSERT_TRUE(expected.has_value());
    const auto image = formats::image(path_.string());
    ASSERT_TRUE(image.ok()) << image.error().message;
    ASSERT_TRUE(same(image->runs, *expected)) << columns << " columns";
  }
}

/// The coded bytes of an image without what stands behind its last row.
std::vector<std::uint8_t> coded_by_encoder(const Runs& runs) {
  formats::g4::Encoder encoder;
  Buffer<std::byte> file;
  const std::size_t end = encoder.encode(runs, file, 0);
  std::vector<std::uint8_t> bytes(end);
  std::memcpy(bytes.data(), file.data(), end);
  return bytes;
}

TEST_F(G4Test, NoEndOfBlockIsNeeded) {
  std::mt19937 random(4);
  const Runs image = mixed_image(random, 900, 60);
  std::vector<std::uint8_t> coded = coded_by_encoder(image);
  coded.resize(coded.size() - 3);
  Buffer<std::byte> bytes(coded.size());
  std::memcpy(bytes.data(), coded.data(), coded.size());
  Runs runs;
  runs.columns = 900;
  runs.row_offset.push_back(0);
  ASSERT_TRUE(G4Decoder().append(bytes, {900, 60, false, false}, runs));
  EXPECT_TRUE(same(runs, image));
}

TEST_F(G4Test, AnImageCodedByHand) {
  // 8 columns: white 2, black 3, white 3 by horizontal mode and a vertical one; the same; blank by pass; black from the left
  // edge on: horizontal 0 and 8; white by pass.
  // 001 0111 10 1 | 1 1 1 | 0001 1 | 001 00110101 000101 | 0001 1: the runs of the last row reach the last column
  const char* const words =
      "001011110"
      "1"
      "111"
      "00011"
      "00100110101000101";
  Buffer<std::byte> bytes;
  for (std::size_t i = 0; i < std::strlen(words); ++i) {
    if (i % 8 == 0) bytes.push_back(std::byte{0});
    if (words[i] == '1') bytes.back() |= static_cast<std::byte>(0x80 >> i % 8);
  }
  Runs runs;
  runs.columns = 8;
  runs.row_offset.push_back(0);
  ASSERT_TRUE(G4Decoder().append(bytes, {8, 4, false, false}, runs));
  EXPECT_EQ(runs.row_offset, (Buffer<std::uint32_t>{0, 2, 4, 4, 6}));
  EXPECT_EQ(runs.change, (Buffer<std::uint32_t>{2, 5, 2, 5, 0, 8}));
}

TEST_F(G4Test, WhatIsTakenOfBrokenCodeIsWhatLibtiffTakes) {
  std::mt19937 random(5);
  int taken = 0, refused = 0;
  for (int i = 0; i < 3000; ++i) {
    const std::uint32_t columns = 1 + pick(random, 300);
    const Tags tags{columns, 12, 12};
    std::vector<std::uint8_t> coded;
    if (i % 3 == 0) {
      coded.resize(1 + pick(random, 60));
      for (std::uint8_t& byte : coded) byte = static_cast<std::uint8_t>(i % 2 == 0 ? random() : random() | random());
    } else {
      coded = coded_by_encoder(mixed_image(random, columns, tags.rows));
      for (int k = 0; k <= i % 2; ++k) coded[random() % coded.size()] ^= static_cast<std::uint8_t>(1u << pick(random, 8));
      if (i % 7 == 0) coded.resize(1 + random() % coded.size());
    }
    Buffer<std::byte> bytes(coded.size());
    std::memcpy(bytes.data(), coded.data(), coded.size());
    Runs runs;
    runs.columns = columns;
    runs.row_offset.push_back(0);
    if (!G4Decoder().append(bytes, {columns, tags.rows, false, false}, runs)) {
      ++refused;
      continue;
    }
    ++taken;
    save_coded(tags, coded);
    const auto expected = by_libtiff(tags);
    ASSERT_TRUE(expected.has_value()) << "image " << i << " is taken, and libtiff complains";
    ASSERT_TRUE(same(runs, *expected)) << "image " << i;
  }
  EXPECT_GT(taken, 100);
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace lamina::formats
