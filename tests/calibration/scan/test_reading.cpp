// tests/calibration/scan/test_reading.cpp: charts read from made-up photographs. LAMINA_SCANS=1000 measures the figures of
// docs/howto/calibrate.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <opencv2/core.hpp>
#include <optional>
#include <random>
#include <vector>

#include "stages/calibration/chart/layout.h"
#include "stages/calibration/chart/rows.h"
#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/reading.h"
#include "stages/data/chart.h"
#include "stages/data/machine.h"
#include "stages/program/head_grid.h"
#include "tests/calibration/scan/synthetic.h"

namespace lamina::test {
namespace {

/// Two heads: 128 nozzles at 45 degrees that scan along x, and 100 in two rows that scan along y.
Machine head_machine(bool along_y) {
  Machine machine;
  machine.name = along_y ? "along y" : "along x";
  machine.mounting.tilt_deg = 45;
  if (!along_y) return machine;
  machine.head.nozzles = 100;
  machine.head.pitch_um = 25'400.0 / 300;
  machine.head.row_offset_um = {0, 2540};
  machine.mounting.dpi = 300;
  machine.mounting.scan_axis = ScanAxis::kY;
  machine.mounting.scan_from = Side::kBack;
  machine.mounting.nozzle_0 = Side::kRight;
  return machine;
}

struct PrintedChart {
  HeadGrid grid;
  Chart chart;
  Runs layer;
};

PrintedChart chart_of(bool along_y) {
  const Machine machine = calibration::chart_machine(head_machine(along_y));
  const auto grid = program::make_head_grid(machine);
  EXPECT_TRUE(grid) << grid.error().message;
  const auto deposited = calibration::layout_chart(machine, *grid);
  EXPECT_TRUE(deposited) << deposited.error().message;
  return {*grid, *deposited, calibration::draw(*deposited)};
}

struct Trial {
  Printing printing;
  Camera camera;
  double row = 0;  // of a head of two rows: how far the second lands from the first along the scan, in pixels of the layer
};

Trial random_trial(const PrintedChart& printed, std::mt19937_64& random) {
  std::mt19937_64 seeded = random;  // of its own: photographs stay what they were
  const auto between = [&](double minimum, double maximum) {
    return std::uniform_real_distribution<double>(minimum, maximum)(random);
  };
  const auto whole = [&](std::uint32_t maximum) { return std::uniform_int_distribution<std::uint32_t>(0, maximum)(random); };
  Trial trial;
  for (std::uint32_t left = whole(6); left > 0; --left) {
    const std::uint32_t nozzle = whole(printed.grid.nozzles - 1);
    trial.printing.blocked.insert(nozzle);
    if (whole(3) == 0 && nozzle > 0) trial.printing.blocked.insert(nozzle - 1);
  }
  std::normal_distribution<double> wander(0, 0.12);
  for (std::uint32_t n = 0; n < printed.grid.nozzles; ++n) {
    const double strays = whole(49) == 0 ? between(-0.8, 0.8) : 0;
    trial.printing.nozzle.push_back({std::clamp(wander(random), -0.4, 0.4), strays + std::clamp(wander(random), -0.4, 0.4)});
  }
  if (printed.chart.nozzle_rows == 2) {
    trial.row = std::uniform_real_distribution<double>(-0.7, 0.7)(seeded);
    for (std::uint32_t n = 1; n < printed.grid.nozzles; n += 2) trial.printing.nozzle[n][0] += trial.row;
  }
  for (std::uint32_t s = 0; s <= printed.grid.lines / printed.grid.swath_lines(); ++s)
    trial.printing.swath.push_back({between(-0.7, 0.7), between(-0.7, 0.7)});
  trial.printing.gain_um = between(0, 40);
  trial.camera = {.pixels_a_mm = between(18, 26),
                  .turn_deg = whole(1) == 0 ? between(-4, 4) : between(0, 360),
                  .tilt_x = between(-0.05, 0.05),
                  .tilt_y = between(-0.05, 0.05),
                  .lens = between(-0.01, 0.01),
                  .margin_mm = between(2, 8),
                  .blur_pixels = between(0.6, 1.6),
                  .noise = between(1, 6),
                  .paper = between(0.6, 0.85),
                  .ink = between(0.06, 0.3),
                  .shade_x = between(-0.25, 0.25),
                  .shade_y = between(-0.25, 0.25),
                  .vignette = between(0, 0.2),
                  .dark_specks = whole(60),
                  .bright_specks = whole(30)};
  return trial;
}

calibration::Photo photo_in_memory(const GreyPicture& picture) {
  cv::Mat grey(picture.height, picture.width, CV_8U);
  for (int y = 0; y < picture.height; ++y)
    std::memcpy(grey.ptr(y), picture.grey.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width),
                static_cast<std::size_t>(picture.width));
  return calibration::photo_of(std::move(grey));
}

Result<calibration::ChartReading> read_trial(const PrintedChart& printed, const Trial& trial, std::mt19937_64& random) {
  const GreyPicture picture = photograph(print_sheet(printed.grid, printed.layer, trial.printing), trial.camera, random);
  return calibration::read_chart_photo(photo_in_memory(picture), printed.chart);
}

/// A straight line through the nozzles' offsets is equivalent to the picture's scale: docs/howto/calibrate.md has the one
/// that is taken off, and along which swaths count: of the slopes of all pairs of nozzles, and of what they leave, the medians.
struct HeadLine {
  double middle = 0, slope = 0;
};
double middle_of_all(std::vector<double> values) {
  std::ranges::sort(values);
  return values.empty() ? 0 : values[values.size() / 2];
}
HeadLine line_through(const Printing& printing, std::size_t axis) {
  std::vector<double> slopes, rest;
  const auto blocked = [&](std::size_t n) { return printing.blocked.contains(static_cast<std::uint32_t>(n)); };
  for (std::size_t j = 0; j < printing.nozzle.size(); ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      if (!blocked(i) && !blocked(j))
        slopes.push_back((printing.nozzle[j][axis] - printing.nozzle[i][axis]) / static_cast<double>(j - i));
    }
  }
  const double slope = middle_of_all(slopes);
  for (std::size_t i = 0; i < printing.nozzle.size(); ++i) {
    if (!blocked(i)) rest.push_back(printing.nozzle[i][axis] - slope * static_cast<double>(i));
  }
  return {middle_of_all(rest), slope};
}

/// How often an error is larger than its reported 99 % bound.
struct Beyond {
  std::size_t all = 0, beyond = 0;
  void add(double off_um, double within_um) {
    ++all;
    beyond += std::abs(off_um) > within_um;
  }
  double percent() const { return 100.0 * static_cast<double>(beyond) / static_cast<double>(std::max<std::size_t>(all, 1)); }
  /// One in a hundred, and three standard deviations of chance.
  double maximum() const { return 0.01 * static_cast<double>(all) + 3 * std::sqrt(0.01 * static_cast<double>(all)); }
};

struct Errors {
  std::vector<double> nozzle, swath, gain_um;  // pixels of the layer
  Beyond nozzles, swaths, rows;                // also of imprecise ones
  std::vector<double> row_um, ragged_um;       // of rows, and of gains where rows lie apart
  std::size_t blocked = 0, found = 0, accused = 0, unread = 0;
  std::size_t nozzles_unreadable = 0, swaths_unreadable = 0;
  std::vector<double> joint_along, joint_across;  // pixels of the layer
  std::size_t stitches_without = 0, stitches_unclear = 0;
};

void add_measure(const calibration::Measure& measure, double pitch_um, double truth, std::vector<double>& errors,
                 Beyond& beyond, std::size_t& unreadable) {
  if (measure.error_um > 0) beyond.add(measure.um - truth * pitch_um, measure.within_um);  // else all its dashes are marred
  if (!measure.known() || 4 * measure.error_um > 0.1 * pitch_um) {  // sharper photographs determine all within that
    ++unreadable;
    return;
  }
  errors.push_back(std::abs(measure.um / pitch_um - truth));
}

void add_errors(const PrintedChart& printed, const Trial& trial, const calibration::ChartReading& reading, Errors& errors) {
  const calibration::HeadReading& head = reading.head;
  const double along_um = printed.grid.position_nm * 1e-3, across_um = printed.grid.line_nm * 1e-3;
  for (const std::uint32_t n : trial.printing.blocked) errors.found += std::ranges::count(head.blocked, n) > 0;
  errors.blocked += trial.printing.blocked.size();
  for (const std::uint32_t n : head.blocked) errors.accused += !trial.printing.blocked.contains(n);
  const HeadLine along = line_through(trial.printing, 0), across = line_through(trial.printing, 1);
  for (std::uint32_t n = 0; n < printed.grid.nozzles; ++n) {
    if (!head.nozzle[n]) continue;
    const auto& reported = trial.printing.nozzle[n];
    add_measure(head.nozzle[n]->along, along_um, reported[0] - along.middle - along.slope * n, errors.nozzle, errors.nozzles,
                errors.nozzles_unreadable);
    add_measure(head.nozzle[n]->across, across_um, reported[1] - across.middle - across.slope * n, errors.nozzle,
                errors.nozzles, errors.nozzles_unreadable);
  }
  const ChartBox& dash = printed.chart.dashes[0].box;
  const bool along_x = printed.chart.scan_along_x, from_end = printed.grid.lines_from_end;
  const std::uint32_t first = along_x ? (from_end ? printed.chart.rows - dash.bottom : dash.top)
                                      : (from_end ? printed.chart.columns - dash.right : dash.left);
  const std::uint32_t base = first / printed.grid.swath_lines();
  for (std::uint32_t s = 1; s < printed.chart.swaths; ++s) {
    if (!head.swath[s]) continue;
    const auto &from = trial.printing.swath[base], &to = trial.printing.swath[base + s];
    const double lines = s * printed.grid.nozzles;
    add_measure(head.swath[s]->along, along_um, to[0] - from[0] - along.slope * lines, errors.swath, errors.swaths,
                errors.swaths_unreadable);
    add_measure(head.swath[s]->across, across_um, to[1] - from[1] - across.slope * lines, errors.swath, errors.swaths,
                errors.swaths_unreadable);
  }
  for (const calibration::JointReading& joint : reading.stitches) {
    const auto &from = trial.printing.swath[base + joint.swath - 1], &to = trial.printing.swath[base + joint.swath];
    const auto off = [&](double um, double pitch_um, std::size_t axis, double slope) {
      return std::abs(um / pitch_um - (to[axis] - from[axis] - slope * printed.grid.nozzles));
    };
    if (joint.along_um) errors.joint_along.push_back(off(*joint.along_um, along_um, 0, along.slope));
    if (joint.across_um) errors.joint_across.push_back(off(*joint.across_um, across_um, 1, across.slope));
    errors.stitches_without += !joint.along_um + !joint.across_um;
    errors.stitches_unclear += !joint.agrees;
  }
  if (printed.chart.nozzle_rows == 2) {
    std::vector<std::optional<calibration::Located>> nozzles;
    for (const auto& one : head.nozzle)
      nozzles.push_back(one && one->along.error_um > 0
                            ? std::optional(calibration::Located{one->along.um, one->along.error_um, 0})
                            : std::nullopt);
    if (const auto row = calibration::rows_of(nozzles, 2)[1]) {
      errors.rows.add(row->um - trial.row * along_um, row->within_um);
      errors.row_um.push_back(std::abs(row->um - trial.row * along_um));
    }
  }
  const calibration::InkReading& inks = reading.inks;
  // Rows that lie apart make the edges of bars along the scan ragged.
  std::vector<double>& along_gains = std::abs(trial.row) < 0.1 ? errors.gain_um : errors.ragged_um;
  if (inks.bars_along > 0) along_gains.push_back(std::abs(inks.gain_along_um - trial.printing.gain_um));
  if (inks.bars_across > 0) errors.gain_um.push_back(std::abs(inks.gain_across_um - trial.printing.gain_um));
}

double share_of(std::vector<double>& values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

/// LAMINA_SCANS=N: the first N; A:B: from A on, below B. Else some, among them one with a swath far from the others, and one
/// whose fourth mark is cut off. Every fifth has no blur.
std::vector<int> scans_of(const char* requested) {
  if (requested == nullptr) return {0, 1, 2, 3, 4, 112, 321};
  const char* colon = std::strchr(requested, ':');
  std::vector<int> scans;
  for (int i = colon == nullptr ? 0 : std::atoi(requested); i < std::atoi(colon == nullptr ? requested : colon + 1); ++i)
    scans.push_back(i);
  return scans;
}

double worst_from(const std::vector<double>& values, std::size_t begin) {
  return begin < values.size() ? *std::max_element(values.begin() + static_cast<std::ptrdiff_t>(begin), values.end()) : 0;
}

TEST(ScannedChart, BlockedNozzlesAreFoundNoneIsAccusedAndOffsetsHold) {
  const char* requested = std::getenv("LAMINA_SCANS");
  const std::vector<int> scans = scans_of(requested);
  const PrintedChart printed[2] = {chart_of(false), chart_of(true)};
  Errors errors;
  for (const int i : scans) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i) * 7919 + 1);
    const PrintedChart& one = printed[i % 2];
    Trial trial = random_trial(one, random);
    if (i % 5 == 4) trial.camera.blur_pixels = 0;  // sharp to the pixel
    const auto reading = read_trial(one, trial, random);
    if (!reading) {
      ++errors.unread;
      errors.blocked += trial.printing.blocked.size();
      ADD_FAILURE() << "scan " << i << ": " << reading.error().message;
      continue;
    }
    const Errors before = errors;
    add_errors(one, trial, *reading, errors);
    const double worst = worst_from(errors.nozzle, before.nozzle.size()), joint = worst_from(errors.swath, before.swath.size());
    const std::size_t missed = errors.blocked - errors.found - (before.blocked - before.found);
    const std::size_t unreadable = errors.nozzles_unreadable - before.nozzles_unreadable,
                      swaths = errors.swaths_unreadable - before.swaths_unreadable;
    if (requested != nullptr &&
        (worst > 0.08 || joint > 0.08 || missed > 0 || errors.accused > before.accused || unreadable + swaths > 0)) {
      printf(
          "scan %d: nozzles within %.3f, swaths %.3f, missed %zu, accused %zu; not reported %zu and %zu; blur %.2f, noise %.1f, %.1f pixels a mm\n",
          i, worst, joint, missed, errors.accused - before.accused, unreadable, swaths, trial.camera.blur_pixels,
          trial.camera.noise, trial.camera.pixels_a_mm);
      std::fflush(stdout);
    }
  }
  printf(
      "%zu scans, %zu not read: %zu of %zu blocked nozzles found, %zu accused wrongly\n"
      "offsets of nozzles, in pixels of the layer: %zu reported, %zu not; half within %.4f, 99.9 %% within %.4f, all within %.4f\n"
      "offsets of swaths: %zu reported, %zu not; half within %.4f, 99 %% within %.4f, all within %.4f\n"
      "beyond the reported interval of 99 in 100: nozzles %.2f %% of %zu, swaths %.2f %% of %zu, rows %.2f %% of %zu\n"
      "rows against the first, in um: half within %.2f, 99 %% within %.2f, all within %.2f\n"
      "joints by verniers: %zu, half within %.4f, 99 %% within %.4f, all within %.4f; by blocks: %zu, half %.4f, 99 %% %.4f, all %.4f; "
      "%zu not read, %zu not as the dashes have them\n"
      "gain in um: half within %.2f, 99 %% within %.2f, all within %.2f; along the scan where rows lie apart: all within %.2f\n",
      scans.size(), errors.unread, errors.found, errors.blocked, errors.accused, errors.nozzle.size(),
      errors.nozzles_unreadable, share_of(errors.nozzle, 0.5), share_of(errors.nozzle, 0.999), share_of(errors.nozzle, 1),
      errors.swath.size(), errors.swaths_unreadable, share_of(errors.swath, 0.5), share_of(errors.swath, 0.99),
      share_of(errors.swath, 1), errors.nozzles.percent(), errors.nozzles.all, errors.swaths.percent(), errors.swaths.all,
      errors.rows.percent(), errors.rows.all, share_of(errors.row_um, 0.5), share_of(errors.row_um, 0.99),
      share_of(errors.row_um, 1), errors.joint_along.size(), share_of(errors.joint_along, 0.5),
      share_of(errors.joint_along, 0.99), share_of(errors.joint_along, 1), errors.joint_across.size(),
      share_of(errors.joint_across, 0.5), share_of(errors.joint_across, 0.99), share_of(errors.joint_across, 1),
      errors.stitches_without, errors.stitches_unclear, share_of(errors.gain_um, 0.5), share_of(errors.gain_um, 0.99),
      share_of(errors.gain_um, 1), share_of(errors.ragged_um, 1));
  EXPECT_GE(static_cast<double>(errors.found), 0.995 * static_cast<double>(errors.blocked));
  EXPECT_EQ(errors.accused, 0u);
  EXPECT_LE(share_of(errors.nozzle, 1), 0.1);
  EXPECT_LE(share_of(errors.swath, 1), 0.1);
  for (const Beyond& kind : {errors.nozzles, errors.swaths, errors.rows}) {
    EXPECT_GT(kind.all, 0u);
    EXPECT_LE(static_cast<double>(kind.beyond), kind.maximum()) << kind.all;
  }
  EXPECT_LE(errors.nozzles_unreadable * 50, errors.nozzle.size());
  EXPECT_LE(errors.swaths_unreadable * 20, errors.swath.size());
  for (const auto* some : {&errors.joint_along, &errors.joint_across, &errors.gain_um, &errors.ragged_um})
    EXPECT_FALSE(some->empty());
  EXPECT_LE(share_of(errors.joint_along, 0.99), 0.15);
  EXPECT_LE(share_of(errors.joint_across, 0.99), 1);
  EXPECT_LE(share_of(errors.gain_um, 0.99), 12);
  EXPECT_LE(share_of(errors.ragged_um, 1), 30);
}

TEST(ScannedChart, OffsetsHoldThroughJitterSatellitesAndGrain) {
  const PrintedChart printed[2] = {chart_of(false), chart_of(true)};
  Errors errors;
  for (const int i : {1000, 1001}) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i) * 7919 + 1);
    const PrintedChart& one = printed[i % 2];
    Trial trial = random_trial(one, random);
    trial.printing.jitter_um = 8;
    trial.printing.satellites = 0.3;
    trial.printing.seed = static_cast<std::uint64_t>(i);
    trial.camera.grain = 0.03;
    const auto reading = read_trial(one, trial, random);
    ASSERT_TRUE(reading) << "scan " << i << ": " << reading.error().message;
    for (const auto& nozzle : reading->head.nozzle) {
      if (!nozzle) continue;
      EXPECT_TRUE(nozzle->along.known() || !(nozzle->along.error_um > 0)) << "an offset along the scan is withheld";
    }
    add_errors(one, trial, *reading, errors);
  }
  EXPECT_EQ(errors.accused, 0u);
  EXPECT_EQ(errors.found, errors.blocked);
  EXPECT_GT(errors.nozzles.all, 400u);
  EXPECT_LE(static_cast<double>(errors.nozzles.beyond), errors.nozzles.maximum()) << errors.nozzles.all;
  EXPECT_LE(static_cast<double>(errors.swaths.beyond), errors.swaths.maximum()) << errors.swaths.all;
}

/// Little noise: what is wrong by more than a tenth of a micrometre or two is the reading's own. Dashes that are searched for
/// where they were detected before, sample by sample, stay there: 1.5 um.
TEST(ScannedChart, NozzlesAreNotHeldWhereTheyWereDetectedBefore) {
  const PrintedChart printed = chart_of(false);
  for (const int i : {24, 34}) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i) * 7919 + 1);
    const Trial trial = random_trial(printed, random);
    const auto reading = read_trial(printed, trial, random);
    ASSERT_TRUE(reading) << reading.error().message;
    const HeadLine across = line_through(trial.printing, 1);
    std::vector<double> off_um;
    for (std::uint32_t n = 0; n < printed.grid.nozzles; ++n) {
      const auto& nozzle = reading->head.nozzle[n];
      if (nozzle && nozzle->across.known())
        off_um.push_back(std::abs(nozzle->across.um - printed.grid.line_nm * 1e-3 *
                                                          (trial.printing.nozzle[n][1] - across.middle - across.slope * n)));
    }
    EXPECT_GT(off_um.size(), 110u);
    EXPECT_LE(share_of(off_um, 0.5), 0.5) << i;
    EXPECT_LE(share_of(off_um, 0.95), 1) << i;
  }
}

}  // namespace
}  // namespace lamina::test
