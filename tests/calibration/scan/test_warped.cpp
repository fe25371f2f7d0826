// tests/calibration/scan/test_warped.cpp: charts and layers from photographs that other means than synthetic.h made.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "stages/calibration/chart/layout.h"
#include "stages/calibration/chart/rows.h"
#include "stages/calibration/scan/compare.h"
#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/reading.h"
#include "stages/data/machine.h"
#include "stages/program/head_grid.h"
#include "tests/calibration/scan/warped.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

Machine head_of(std::uint32_t nozzles, double dpi, std::vector<double> row_offset_um) {
  Machine machine;
  machine.name = "warped";
  machine.head.nozzles = nozzles;
  machine.head.pitch_um = 25'400.0 / dpi;
  machine.head.row_offset_um = std::move(row_offset_um);
  machine.mounting.dpi = dpi;
  return machine;
}

/// Rows, blocked nozzles and single offsets, on sharp and blurred images of sheets, with other sampling, as JPEG.
TEST(WarpedPhotograph, ReportsWhatAChartWasPrintedWith) {
  const Directory directory;
  const std::vector<double> row_um{0, 45, -30, 12};
  const std::set<std::uint32_t> blocked{7, 90};
  const Machine machine = calibration::chart_machine(head_of(160, 360, {0, 2540, 5080, 7620}));
  const auto grid = program::make_head_grid(machine);
  ASSERT_TRUE(grid) << grid.error().message;
  const auto deposited = calibration::layout_chart(machine, *grid);
  ASSERT_TRUE(deposited) << deposited.error().message;
  ASSERT_TRUE(deposited->scan_along_x);
  std::vector<std::optional<std::uint32_t>> nozzle_of_row(deposited->rows);
  for (const ChartDash& dash : deposited->dashes) nozzle_of_row[dash.box.top] = dash.nozzle;
  // Each seventh nozzle strays across, in addition to its row.
  const auto across_um = [](std::uint32_t n) { return n % 7 == 3 ? 24.0 : 0.0; };
  const InkedSheet sheet = inked_sheet(calibration::draw(*deposited), deposited->pixel_x_nm * 1e-6,
                                       deposited->pixel_y_nm * 1e-6, [&](std::uint32_t row) -> std::optional<cv::Point2d> {
                                         if (!nozzle_of_row[row]) return cv::Point2d();
                                         const std::uint32_t n = *nozzle_of_row[row];
                                         if (blocked.contains(n)) return std::nullopt;
                                         return cv::Point2d(deposited->along_sign * 1e-3 * row_um[n % 4],
                                                            deposited->across_sign * 1e-3 * across_um(n));
                                       });
  const Shot shots[] = {
      {.pixels_a_mm = 22, .turn_deg = 3, .keystone = 0.03, .noise = 2, .jpeg_quality = 90},
      {.pixels_a_mm = 22, .turn_deg = 0, .noise = 1, .jpeg_quality = 0},
      {.pixels_a_mm = 18,
       .turn_deg = 187,
       .keystone = 0.02,
       .interpolation = cv::INTER_LANCZOS4,
       .blur_pixels = 0.8,
       .noise = 3,
       .jpeg_quality = 75},
      {.pixels_a_mm = 25, .turn_deg = 95, .finer = 1, .interpolation = cv::INTER_CUBIC, .noise = 2, .jpeg_quality = 90}};
  for (const Shot& shot : shots) {
    SCOPED_TRACE(shot.turn_deg);
    const auto photo = calibration::read_photo(photograph_to(directory / "chart", sheet, shot), 200);
    ASSERT_TRUE(photo) << photo.error().message;
    const auto reading = calibration::read_chart_photo(*photo, *deposited);
    ASSERT_TRUE(reading) << reading.error().message;
    const calibration::HeadReading& head = reading->head;
    EXPECT_EQ(head.blocked, std::vector<std::uint32_t>(blocked.begin(), blocked.end()));
    std::vector<std::optional<calibration::Located>> along(head.nozzle.size());
    for (std::uint32_t n = 0; n < head.nozzle.size(); ++n) {
      if (!head.nozzle[n]) continue;
      along[n] = calibration::Located{head.nozzle[n]->along.um, head.nozzle[n]->along.error_um, 0};
      const double off = head.nozzle[n]->across.um - across_um(n);
      EXPECT_LE(std::abs(off), 0.1e-3 * deposited->pixel_y_nm) << n;
    }
    const auto rows = calibration::rows_of(along, 4);
    for (std::uint32_t r = 1; r < 4; ++r) {
      ASSERT_TRUE(rows[r]);
      EXPECT_NEAR(rows[r]->um, row_um[r] - row_um[0], rows[r]->within_um + 0.5) << r;
      EXPECT_LE(rows[r]->within_um, 4) << r;
    }
  }
}

/// A planted blot is reported with position and area; a scratch narrower than half a millimetre is not.
TEST(WarpedPhotograph, ReportsInkThatTheLayerDoesNotHave) {
  const Directory directory;
  const double pitch_mm = 0.1, x_mm = 47, y_mm = 33, radius_mm = 1.2;
  Runs layer{800, {0}, {}};
  for (std::uint32_t r = 0; r < 700; ++r) {
    if (r >= 250 && r < 310) layer.change.insert(layer.change.end(), {200, 380});
    if (r >= 310 && r < 480) layer.change.insert(layer.change.end(), {200, 260});
    layer.row_offset.push_back(static_cast<std::uint32_t>(layer.change.size()));
  }
  InkedSheet sheet = inked_sheet(
      layer, pitch_mm, pitch_mm, [](std::uint32_t) { return cv::Point2d(); }, 15);
  const auto cell = [&](double x, double y) {
    return cv::Point(static_cast<int>(std::lround((x - sheet.left_mm) * InkedSheet::kCellsAMm)),
                     static_cast<int>(std::lround((y - sheet.top_mm) * InkedSheet::kCellsAMm)));
  };
  cv::circle(sheet.cells, cell(x_mm, y_mm), static_cast<int>(radius_mm * InkedSheet::kCellsAMm), 0, cv::FILLED);
  cv::line(sheet.cells, cell(32, 40), cell(40, 44), 0, 25);
  for (const Shot& shot : {Shot{.pixels_a_mm = 10, .turn_deg = 2, .keystone = 0.01, .noise = 3, .jpeg_quality = 85},
                           Shot{.pixels_a_mm = 10.2, .turn_deg = -3, .blur_pixels = 0.8, .noise = 2, .jpeg_quality = 0}}) {
    SCOPED_TRACE(shot.turn_deg);
    const auto photo = calibration::read_photo(photograph_to(directory / "layer", sheet, shot), 50);
    ASSERT_TRUE(photo) << photo.error().message;
    const auto detected = calibration::compare_layer(*photo, {layer.view(), 1e6 * pitch_mm, 1e6 * pitch_mm, true, 100});
    ASSERT_TRUE(detected) << detected.error().message;
    EXPECT_TRUE(detected->bands.empty());
    ASSERT_EQ(detected->extra.size(), 1u);
    EXPECT_NEAR(detected->extra[0].x_mm, x_mm, 0.1);
    EXPECT_NEAR(detected->extra[0].y_mm, y_mm, 0.1);
    EXPECT_NEAR(detected->extra[0].mm2, std::numbers::pi * radius_mm * radius_mm, 0.45);
    ASSERT_EQ(detected->bodies.size(), 1u);
    EXPECT_NEAR(detected->bodies[0].detected_mm2, detected->bodies[0].expected_mm2, 0.02 * detected->bodies[0].expected_mm2);
  }
}

}  // namespace
}  // namespace lamina::test
