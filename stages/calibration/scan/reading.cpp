#include "stages/calibration/scan/reading.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "stages/calibration/scan/marks.h"

namespace lamina::calibration {
namespace {

constexpr std::size_t kFewest = 30, kEnoughForLens = 200;  // dashes
constexpr double kFaintBar = 0.3;                          // of full ink
constexpr double kClosest = 4.5;                           // pixels from a dash to the one next to it

std::uint32_t first_of(const std::vector<bool>& printed) {
  return static_cast<std::uint32_t>(std::ranges::find(printed, true) - printed.begin());
}

/// Fits the view, the swaths and the nozzles to the dashes, and detects them again, three times. False if too few are detected.
bool settle(const Photo& photo, const Chart& chart, ChartReading& reading) {
  std::optional<DashShapes> shapes;
  reading.dashes = see_dashes(photo, chart, reading.fit, shapes);
  shapes.reset();  // blurred by a view of the marks alone
  for (int round = 0; round < 3; ++round) {
    const std::vector<bool> printed = printed_swaths(chart, reading.dashes);
    const std::vector<Sighting> sightings = sightings_of(chart, reading.dashes, reading.fit.view, printed);
    if (sightings.size() < kFewest) return false;
    fit_sheet(sightings, first_of(printed), sightings.size() >= kEnoughForLens, reading.fit);
    reading.dashes = see_dashes(photo, chart, reading.fit, shapes);
  }
  return true;
}

}  // namespace

Result<ChartReading> read_chart_photo(const Photo& photo, const Chart& chart) {
  const auto view = find_marks(photo, chart);
  if (!view) return view.error();
  const Spot m = middle_of({0, 0, chart.columns, chart.rows}, chart);
  if (const double pixels = view->pixels_a_mm(m.x, m.y); pixels * chart.between_mm < kClosest)
    return Error{Fault::kInput, fmt::format("the photograph has {:.1f} pixels per mm; at least {:.0f} are needed to resolve "
                                            "the dashes: photograph the chart from closer",
                                            pixels, std::ceil(kClosest / chart.between_mm))};
  ChartReading reading;
  reading.fit = {*view, std::vector<Spot>(chart.swaths), std::vector<Spot>(chart.nozzles)};
  const bool settled = settle(photo, chart, reading);
  const auto there =
      static_cast<std::size_t>(std::ranges::count_if(reading.dashes, [](const DashReading& one) { return one.there; }));
  if (!settled || there < kFewest || there * 10 < chart.dashes.size())
    return Error{Fault::kInput,
                 "the chart is found, but fewer than a tenth of its dashes: photograph it sharper, or from nearer"};
  const std::vector<bool> printed = printed_swaths(chart, reading.dashes);
  reading.pixels_a_mm = reading.fit.view.pixels_a_mm(m.x, m.y);
  reading.scatter_um = 1000 * reading.fit.scatter_pixels / reading.pixels_a_mm;
  reading.head = read_head(chart, reading.dashes, printed, reading.fit, there >= kEnoughForLens);
  reading.inks = read_inks(photo, chart, reading.fit, reading.head);
  if (reading.inks.bars_detected > 0 && reading.inks.full < kFaintBar * photo.ink)
    return Error{Fault::kInput,
                 "the chart is found, but its bars are not where they should be: photograph it with all four marks and "
                 "nothing else around it"};
  reading.stitches = read_stitches(photo, chart, reading.fit, reading.head, reading.inks);
  return reading;
}

cv::Mat picture_of(const Photo& photo, const Chart& chart, const ChartReading& reading) {
  cv::Mat picture;
  cv::cvtColor(photo.grey, picture, cv::COLOR_GRAY2BGR);
  const auto at = [&](const Spot& mm) {
    const Spot p = reading.fit.view.at(mm.x, mm.y);
    return cv::Point(static_cast<int>(std::lround(p.x)), static_cast<int>(std::lround(p.y)));
  };
  const cv::Scalar green(60, 170, 40), red(40, 40, 220), orange(20, 140, 240), blue(200, 120, 30);
  for (std::size_t d = 0; d < reading.dashes.size(); ++d) {
    const DashReading& detected = reading.dashes[d];
    const ChartBox& box = chart.dashes[d].box;
    const Spot m = middle_of(box, chart), a{box.left * 1e-6 * chart.pixel_x_nm - m.x, box.top * 1e-6 * chart.pixel_y_nm - m.y};
    const Spot half = chart.scan_along_x ? Spot{a.x, 0} : Spot{0, a.y};
    const cv::Scalar& colour = detected.hidden ? orange : detected.there ? green : red;
    cv::line(picture, at({detected.position.x + half.x, detected.position.y + half.y}),
             at({detected.position.x - half.x, detected.position.y - half.y}), colour, detected.there ? 1 : 2, cv::LINE_AA);
  }
  for (const ChartBox& mark : chart.marks) {
    const Spot m = middle_of(mark, chart);
    cv::circle(picture, at(m), static_cast<int>(1.3 * chart.mark_mm * reading.pixels_a_mm), blue, 2, cv::LINE_AA);
  }
  return picture;
}

}  // namespace lamina::calibration
