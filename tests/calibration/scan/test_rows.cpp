// tests/calibration/scan/test_rows.cpp: rows of a fine head that land too far, on a photograph that shows no single nozzle well
// enough.
#include <gtest/gtest.h>

#include <cstring>
#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <vector>

#include "pipeline/calibrate/chart_job.h"
#include "pipeline/calibrate/scan_answer.h"
#include "stages/calibration/chart/layout.h"
#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/reading.h"
#include "stages/program/head_grid.h"
#include "tests/calibration/scan/synthetic.h"

namespace lamina::test {
namespace {

constexpr std::uint32_t kRows = 4;

/// 720 dpi, four rows.
Machine fine_head() {
  Machine machine;
  machine.name = "fine";
  machine.head.nozzles = 240;
  machine.head.pitch_um = 25'400.0 / 720;
  machine.head.row_offset_um = {0, 2540, 5080, 7620};
  machine.mounting.dpi = 720;
  return machine;
}

struct RowsRead {
  std::vector<double> row_offset_um;
  std::string lines;
  std::size_t precise = 0;  // nozzles that 4 sigma along the scan holds within a tenth of a pixel
};

/// shift_um  of each row, further along the scan
RowsRead read_rows(const std::vector<double>& shift_um, const Camera& camera) {
  RowsRead read;
  Machine machine = calibration::chart_machine(fine_head());
  const auto grid = program::make_head_grid(machine);
  EXPECT_TRUE(grid) << grid.error().message;
  const auto deposited = calibration::layout_chart(machine, *grid);
  EXPECT_TRUE(deposited) << deposited.error().message;
  Printing printing;
  for (std::uint32_t n = 0; n < grid->nozzles; ++n)
    printing.nozzle.push_back({shift_um[n % kRows] * 1e3 / grid->position_nm, 0});
  std::mt19937_64 random(7);
  const GreyPicture picture = photograph(print_sheet(*grid, calibration::draw(*deposited).view(), printing), camera, random);
  cv::Mat grey(picture.height, picture.width, CV_8U);
  std::memcpy(grey.data, picture.grey.data(), picture.grey.size());
  const auto reading = calibration::read_chart_photo(calibration::photo_of(std::move(grey)), *deposited);
  EXPECT_TRUE(reading) << reading.error().message;
  if (!reading) return read;
  for (const auto& nozzle : reading->head.nozzle)
    read.precise += nozzle && nozzle->along.known() && 4 * nozzle->along.error_um <= 1e-4 * grid->position_nm;
  const auto lines = pipeline::take_over(json_line(pipeline::reading_json(*reading)), *deposited, machine);
  EXPECT_TRUE(lines) << lines.error().message;
  for (const std::string& line : *lines) read.lines += line + "\n";
  read.row_offset_um = machine.head.row_offset_um;
  return read;
}

TEST(ScannedRows, RowsFarOffAreReportedWhereNoNozzleIsPrecise) {
  const std::vector<double> shift_um{0, 70, 0, -20};
  for (const double pixels_a_mm : {18.0, 24.0}) {
    const RowsRead read = read_rows(shift_um, {.pixels_a_mm = pixels_a_mm, .turn_deg = 3, .noise = pixels_a_mm / 6});
    EXPECT_LT(read.precise, 60u) << read.lines;
    ASSERT_EQ(read.row_offset_um.size(), kRows);
    for (std::uint32_t r = 0; r < kRows; ++r) EXPECT_NEAR(read.row_offset_um[r], 2540 * r - shift_um[r], 2) << read.lines;
    EXPECT_NE(read.lines.find("rows      against the first one, change of -"), std::string::npos) << read.lines;
  }
}

/// What is within, is within: of a head whose row lands 70 um off, not two.
TEST(ScannedRows, WithinIsSaidOfAllNozzlesThatWereRead) {
  const RowsRead read = read_rows({0, 70, 0, 0}, {.pixels_a_mm = 18, .noise = 8});
  const std::size_t at = read.lines.find("within ", read.lines.find("nozzles   240 read"));
  ASSERT_NE(at, std::string::npos) << read.lines;
  EXPECT_GE(std::stod(read.lines.substr(at + 7)), 66) << read.lines;
  // As noisy as rows are, each is reported with its limit; only the one that is far off changes the profile.
  ASSERT_EQ(read.row_offset_um.size(), kRows);
  EXPECT_NEAR(read.row_offset_um[1], 2540 - 70, 10) << read.lines;
  EXPECT_EQ(read.row_offset_um[2], 5080) << read.lines;
  EXPECT_EQ(read.row_offset_um[3], 7620) << read.lines;
  EXPECT_NE(read.lines.find("; profile unchanged)"), std::string::npos) << read.lines;
}

}  // namespace
}  // namespace lamina::test
