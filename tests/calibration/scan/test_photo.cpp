// tests/calibration/scan/test_photo.cpp: photographs of any kind are the same picture, and what shows no chart ends in a line.
#include <gtest/gtest.h>
#include <tiffio.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <vector>

#include "stages/calibration/chart/layout.h"
#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/reading.h"
#include "stages/data/machine.h"
#include "stages/program/head_grid.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

constexpr int kWide = 60, kHigh = 40;

std::vector<std::uint8_t> some_greys() {
  std::mt19937 random(3);
  std::vector<std::uint8_t> greys(kWide * kHigh);
  for (std::uint8_t& grey : greys) grey = static_cast<std::uint8_t>(random() % 256);
  return greys;
}

struct Kind {
  std::uint16_t samples, bits, orientation = 1;
  std::uint8_t alpha = 255;
};

/// A TIFF whose pixels, in the order of the file, have these greys; even samples are opacity, not multiplied into colours.
void write_photo(const std::string& path, const std::vector<std::uint8_t>& greys, int wide, int high, const Kind& kind) {
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  ASSERT_NE(tiff, nullptr);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, wide);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, high);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, kind.samples);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, kind.bits);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, kind.orientation);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, kind.samples < 3 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  if (kind.samples % 2 == 0) {
    const std::uint16_t straight = EXTRASAMPLE_UNASSALPHA;
    TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &straight);
  }
  for (int y = 0; y < high; ++y) {
    std::vector<std::uint8_t> row;
    for (int x = 0; x < wide; ++x) {
      for (int s = 0; s < kind.samples; ++s) {
        const bool opacity = kind.samples % 2 == 0 && s == kind.samples - 1;
        const std::uint8_t value = opacity ? kind.alpha : greys[static_cast<std::size_t>(y * wide + x)];
        row.insert(row.end(), kind.bits / 8, value);  // 257 times of 16 bits
      }
    }
    ASSERT_GE(TIFFWriteScanline(tiff, row.data(), static_cast<std::uint32_t>(y)), 0);
  }
  TIFFClose(tiff);
}

void expect_greys(const cv::Mat& grey, const std::vector<std::uint8_t>& greys, const std::string& what) {
  ASSERT_EQ(grey.cols, kWide) << what;
  ASSERT_EQ(grey.rows, kHigh) << what;
  for (int y = 0; y < kHigh; ++y)
    ASSERT_EQ(std::memcmp(grey.ptr(y), greys.data() + y * kWide, kWide), 0) << what << " row " << y;
}

TEST(Photo, GreyColourOpacityAndSixteenBitsAreOnePicture) {
  const Directory directory;
  const std::string path = directory / "photo.tif";
  const auto greys = some_greys();
  for (const std::uint16_t samples : std::initializer_list<std::uint16_t>{1, 2, 3, 4}) {
    for (const std::uint16_t bits : std::initializer_list<std::uint16_t>{8, 16}) {
      write_photo(path, greys, kWide, kHigh, {samples, bits});
      const auto photo = calibration::read_photo(path, 20);
      ASSERT_TRUE(photo) << photo.error().message;
      expect_greys(photo->grey, greys, std::to_string(samples) + " samples of " + std::to_string(bits));
    }
    if (samples % 2 == 1) continue;
    write_photo(path, greys, kWide, kHigh, {samples, 8, 1, 0});
    const auto clear = calibration::read_photo(path, 20);
    ASSERT_TRUE(clear);
    expect_greys(clear->grey, std::vector<std::uint8_t>(greys.size(), 255), "transparent");
  }
}

/// The eight orientations of TIFF 6.0 say which sides of the picture the first row and the first column of the file are.
TEST(Photo, IsTurnedAsTheCameraWasHeld) {
  const Directory directory;
  const std::string path = directory / "photo.tif";
  const auto greys = some_greys();
  struct Sides {
    bool rows_are_columns, from_right, from_bottom;  // the file's first pixel is at the picture's right, at its bottom
  };
  const Sides all[] = {{false, false, false}, {false, true, false}, {false, true, true}, {false, false, true},
                       {true, false, false},  {true, true, false},  {true, true, true},  {true, false, true}};
  for (std::uint16_t o = 1; o <= 8; ++o) {
    const Sides& sides = all[o - 1];
    const int wide = sides.rows_are_columns ? kHigh : kWide, high = sides.rows_are_columns ? kWide : kHigh;
    std::vector<std::uint8_t> file(greys.size());
    for (int y = 0; y < high; ++y) {
      for (int x = 0; x < wide; ++x) {
        int px = sides.rows_are_columns ? y : x, py = sides.rows_are_columns ? x : y;
        if (sides.from_right) px = kWide - 1 - px;
        if (sides.from_bottom) py = kHigh - 1 - py;
        file[static_cast<std::size_t>(y * wide + x)] = greys[static_cast<std::size_t>(py * kWide + px)];
      }
    }
    write_photo(path, file, wide, high, {1, 8, o});
    const auto photo = calibration::read_photo(path, 20);
    ASSERT_TRUE(photo) << photo.error().message;
    expect_greys(photo->grey, greys, "orientation " + std::to_string(o));
  }
}

TEST(Photo, WhatCannotBeReadOrIsTooSmallOrTooLargeIsRefusedInALine) {
  const Directory directory;
  const std::string path = directory / "photo.tif", pgm = directory / "photo.pgm";
  write_photo(path, some_greys(), kWide, kHigh, {1, 8});
  const auto put = [&](const std::string& bytes) { std::ofstream(pgm, std::ios::binary) << bytes; };
  const auto expect_refused = [](const std::string& file, int minimum, const std::string& words) {
    const auto photo = calibration::read_photo(file, minimum);
    ASSERT_FALSE(photo) << words;
    EXPECT_EQ(photo.error().fault, Fault::kInput);
    EXPECT_NE(photo.error().message.find(words), std::string::npos) << photo.error().message;
    EXPECT_EQ(std::ranges::count(photo.error().message, '\n'), 0) << photo.error().message;
  };
  expect_refused(path, 50, "60 x 40 pixels; 50 and more");
  expect_refused(directory / "absent.png", 50, "no photograph");
  put("P5\n60000 60000\n255\n");
  expect_refused(pgm, 50, "2^27");
  put("P5\n600 600\n255\nabc");
  expect_refused(pgm, 50, "photo.pgm: ");
  put("");
  expect_refused(pgm, 50, "photo.pgm: ");
}

TEST(Photo, SheetsWithoutAChartEndInALine) {
  Machine machine;
  machine.mounting.tilt_deg = 45;
  const auto grid = program::make_head_grid(calibration::chart_machine(machine));
  ASSERT_TRUE(grid);
  const auto deposited = calibration::layout_chart(calibration::chart_machine(machine), *grid);
  ASSERT_TRUE(deposited);
  std::mt19937 random(7);
  const auto refused = [&](const char* what, const cv::Mat& grey) {
    const auto reading = calibration::read_chart_photo(calibration::photo_of(grey.clone()), *deposited);
    ASSERT_FALSE(reading) << what;
    EXPECT_EQ(reading.error().fault, Fault::kInput);
    EXPECT_EQ(std::ranges::count(reading.error().message, '\n'), 0);
  };
  refused("white", cv::Mat(300, 400, CV_8U, cv::Scalar(255)));
  refused("black", cv::Mat(300, 400, CV_8U, cv::Scalar(0)));
  cv::Mat noise(300, 400, CV_8U), specks(300, 400, CV_8U, cv::Scalar(230)), stripes(300, 400, CV_8U);
  for (int y = 0; y < 300; ++y) {
    for (int x = 0; x < 400; ++x) {
      noise.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(random() % 256);
      stripes.at<std::uint8_t>(y, x) = x / 7 % 2 == 0 ? 30 : 220;
      if ((x % 50 - 25) * (x % 50 - 25) + (y % 50 - 25) * (y % 50 - 25) < 100) specks.at<std::uint8_t>(y, x) = 20;
    }
  }
  refused("noise", noise);
  refused("discs", specks);
  refused("stripes", stripes);
}

}  // namespace
}  // namespace lamina::test
