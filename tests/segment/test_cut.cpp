#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>

#include "stages/segment/cut.h"

namespace lamina::segment {
namespace {

struct Piece {
  std::int64_t begin, end;
  Thickness thickness;
  friend bool operator==(const Piece&, const Piece&) = default;
};

std::vector<Piece> pieces(const LineCut& cut, std::int64_t from, std::int64_t to) {
  std::vector<Piece> list;
  cut_line(cut, from, to, [&](std::int64_t a, std::int64_t b, Thickness t) { list.push_back({a, b, t}); });
  return list;
}

/// As the notes on Fukuda 2020 write it: the start of each stretch and its kind; nothing for a line that is not divided.
std::string published(std::int64_t from, std::int64_t to) {
  LineCut cut{CutRule::kGrid, 5'000'000, 3'000'000};
  std::string text;
  for (const auto& p : pieces(cut, from, to)) {
    if (p.thickness == Thickness::kReference) continue;
    text +=
        (text.empty() ? "" : " ") + std::to_string(p.begin / kNmPerMm) + (p.thickness == Thickness::kThin ? ":thin" : ":thick");
  }
  return text;
}

TEST(CutLine, ExamplesOfFukudaComeOutToTheLetter) {
  constexpr std::int64_t k = kNmPerMm;
  EXPECT_EQ(published(0, 20 * k), "0:thin 5:thick 8:thin 13:thick 16:thin");
  EXPECT_EQ(published(4 * k, 20 * k), "4:thin 5:thick 8:thin 13:thick 16:thin");
  EXPECT_EQ(published(6 * k, 20 * k), "6:thick 8:thin 13:thick 16:thin");
  EXPECT_EQ(published(8 * k, 20 * k), "8:thin 13:thick 16:thin");
  EXPECT_EQ(published(6 * k, 7'500'000), "");
  EXPECT_EQ(published(1 * k, 4 * k), "");
  // Ends on a mark: the mark divides the line but adds no stretch behind it; a start on a mark has no empty stretch.
  EXPECT_EQ(published(1 * k, 5 * k), "1:thin");
  EXPECT_EQ(published(5 * k, 20 * k), "5:thick 8:thin 13:thick 16:thin");
}

/// The algorithm of Fukuda 2020 as its pseudocode has it, in whole numbers.
std::vector<Piece> fukuda(std::int64_t from, std::int64_t to, const LineCut& cut) {
  const std::int64_t period = cut.thin + cut.thick;
  std::int64_t x = floor_div(from - cut.origin, period) * period + cut.origin + cut.thin;
  bool thin = true;
  if (x < from) x += cut.thick, thin = false;
  if (x > to) return {{from, to, Thickness::kReference}};
  std::vector<std::pair<std::int64_t, bool>> list{{from, thin}};
  thin = !thin;
  while (x < to) {
    list.emplace_back(x, thin);
    x += thin ? cut.thin : cut.thick;
    thin = !thin;
  }
  std::vector<Piece> pieces;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::int64_t end = i + 1 < list.size() ? list[i + 1].first : to;
    if (end > list[i].first) pieces.push_back({list[i].first, end, list[i].second ? Thickness::kThin : Thickness::kThick});
  }
  return pieces;
}

TEST(CutLine, LawsHoldForRandomLines) {
  std::mt19937_64 random(7);
  const auto between = [&](std::int64_t low, std::int64_t high) {
    return std::uniform_int_distribution<std::int64_t>(low, high)(random);
  };
  for (int i = 0; i < 60'000; ++i) {
    LineCut cut;
    cut.rule = static_cast<CutRule>(i % 3);
    const bool small = between(0, 1) == 0;  // marks and ends meet often
    cut.thin = between(1, small ? 6 : 5'000'000);
    cut.thick = between(1, small ? 6 : 5'000'000);
    cut.origin = between(small ? -9 : -90'000'000, small ? 9 : 90'000'000);
    cut.min_end = between(0, 1) == 0 ? 0 : cut.thick / 2;
    const std::int64_t from = between(small ? -40 : -400'000'000, small ? 40 : 400'000'000);
    const std::int64_t to = from + between(1, small ? 60 : 100'000'000);
    const auto list = pieces(cut, from, to);
    // --- they cover the line, none is empty, kinds alternate
    ASSERT_FALSE(list.empty());
    ASSERT_EQ(list.front().begin, from);
    ASSERT_EQ(list.back().end, to);
    std::int64_t min_thin = INT64_MAX;
    for (std::size_t k = 0; k < list.size(); ++k) {
      ASSERT_LT(list[k].begin, list[k].end);
      if (k > 0) {
        ASSERT_EQ(list[k].begin, list[k - 1].end);
        ASSERT_NE(list[k].thickness, list[k - 1].thickness);
      }
      if (list[k].thickness == Thickness::kThin) min_thin = std::min(min_thin, list[k].end - list[k].begin);
    }
    if (cut.rule == CutRule::kGrid) {
      ASSERT_EQ(list, fukuda(from, to, cut));
    } else {
      // --- no pore at an end, every thin stretch whole
      ASSERT_EQ(list.front().thickness, Thickness::kThick);
      ASSERT_EQ(list.back().thickness, Thickness::kThick);
      if (list.size() > 1) {
        ASSERT_EQ(min_thin, cut.thin);
        ASSERT_GE(list.front().end - list.front().begin, std::max<std::int64_t>(cut.min_end, 1));
        ASSERT_GE(list.back().end - list.back().begin, std::max<std::int64_t>(cut.min_end, 1));
      }
      for (std::size_t k = 1; k + 1 < list.size(); ++k) {
        if (list[k].thickness == Thickness::kThick) {
          ASSERT_EQ(list[k].end - list[k].begin, cut.thick);
        } else if (cut.rule == CutRule::kAligned) {
          ASSERT_EQ((list[k].begin - cut.origin) % (cut.thin + cut.thick), 0);
        }
      }
      // --- as many as fit
      if (cut.rule == CutRule::kThickEnds) {
        const auto count = static_cast<std::int64_t>(list.size() / 2);
        const std::int64_t minimum = 2 * std::max<std::int64_t>(cut.min_end, 1);
        ASSERT_GT((count + 1) * cut.thin + count * cut.thick + minimum, to - from);
        ASSERT_LE(std::abs((list.front().end - from) - (to - list.back().begin)), list.size() == 1 ? to - from : 1);
      }
    }
    // --- walked the other way, the same cuts
    if (cut.rule != CutRule::kThickEnds) {
      auto mirrored = pieces(cut.mirrored(), -to, -from);
      std::reverse(mirrored.begin(), mirrored.end());
      for (auto& p : mirrored) p = {-p.end, -p.begin, p.thickness};
      if (cut.rule == CutRule::kAligned) {
        ASSERT_EQ(mirrored, list);
      }
    }
  }
}

TEST(CutLine, LengthsOfTheSpeedTestGiveOneThinIntervalBetweenEqualEnds) {
  LineCut cut{CutRule::kThickEnds, 30'000'000, 10'000'000, 0, 5'000'000};
  const std::vector<Piece> whole = {{0, 10'000'000, Thickness::kThick},
                                    {10'000'000, 40'000'000, Thickness::kThin},
                                    {40'000'000, 50'000'000, Thickness::kThick}};
  EXPECT_EQ(pieces(cut, 0, 50'000'000), whole);
  // Inside of a contour the line is a little shorter: the ends share what is missing.
  const std::vector<Piece> inside = {{400'000, 10'000'000, Thickness::kThick},
                                     {10'000'000, 40'000'000, Thickness::kThin},
                                     {40'000'000, 49'600'000, Thickness::kThick}};
  EXPECT_EQ(pieces(cut, 400'000, 49'600'000), inside);
}

/// A zigzag of `count` lines of length 20 mm along an angle, 0.4 mm apart, joined by links.
Toolpaths zigzag(std::int32_t first, std::int32_t count, double degrees) {
  Toolpaths paths;
  const double c = std::cos(degrees * 3.14159265358979 / 180), s = std::sin(degrees * 3.14159265358979 / 180);
  const auto at = [&](double u, double v) {
    return Point2{static_cast<Nm>(std::llround(1e6 * (100 + u * c - v * s))),
                  static_cast<Nm>(std::llround(1e6 * (100 + u * s + v * c)))};
  };
  for (std::int32_t n = first; n < first + count; ++n) {
    const bool odd = (n & 1) != 0;
    const double v = 0.4 * n;
    paths.add(at(odd ? 20 : 0, v), PathKind::kRaster, 400'000, n);
    paths.add(at(odd ? 0 : 20, v), n + 1 < first + count ? PathKind::kLink : PathKind::kRaster, 400'000,
              n + 1 < first + count ? kNoLine : n);
  }
  paths.close();
  return paths;
}

TEST(ExpandToolpaths, SegmentedLinesAreAllDepositedOneDirectionRegardlessOfWhatIsBetweenThem) {
  for (const double degrees : {0.0, 90.0, 37.0, 135.0}) {
    for (std::uint32_t continuous = 1; continuous <= 4; ++continuous) {
      const Toolpaths paths = zigzag(-3, 20, degrees);
      LayerCut cut;
      cut.on = true;
      cut.continuous = continuous;
      cut.along_x = std::cos(degrees * 3.14159265358979 / 180);
      cut.along_y = std::sin(degrees * 3.14159265358979 / 180);
      double length = 0;
      std::uint32_t segmented = 0;
      std::int32_t last_line = kNoLine;
      Point2 at{};
      for_each_interval(paths, cut, [&](const PathInterval& s) {
        if (!s.jump) {
          ASSERT_EQ(s.from, at);
        }
        at = s.to;
        if (s.kind != PathKind::kRaster) return;
        length += expand_detail::distance(s.from, s.to);
        if (s.thickness == Thickness::kReference) return;
        ASSERT_EQ(s.line % static_cast<std::int32_t>(continuous + 1), 0);
        if (s.line != last_line) ++segmented;
        last_line = s.line;
        ASSERT_GT((s.to.x - s.from.x) * cut.along_x + (s.to.y - s.from.y) * cut.along_y, 0) << "deposited against the others";
      });
      EXPECT_NEAR(length, 20 * 20e6, 100);
      std::uint32_t expected = 0;
      for (std::int32_t n = -3; n < 17; ++n) expected += n % static_cast<std::int32_t>(continuous + 1) == 0;
      EXPECT_EQ(segmented, expected);
    }
  }
}

TEST(ExpandToolpaths, PlainPathsComeOutAsTheyAreStored) {
  const Toolpaths paths = zigzag(0, 9, 12);
  std::vector<Point2> points;
  for_each_interval(paths, LayerCut{}, [&](const PathInterval& s) {
    EXPECT_EQ(s.jump, points.empty());
    if (s.jump) points.push_back(s.from);
    points.push_back(s.to);
  });
  EXPECT_TRUE(std::equal(points.begin(), points.end(), paths.point.begin(), paths.point.end()));
}

TEST(ExpandToolpaths, ClosedCurvesAreCutIntoWholePeriodsFromTheMiddleOfAThickInterval) {
  std::mt19937 random(5);
  for (int turn = 0; turn < 300; ++turn) {
    const int corners = 3 + static_cast<int>(random() % (turn % 2 == 0 ? 400 : 5));
    const double radius = 1e5 + static_cast<double>(random() % 15'000'000);
    Toolpaths paths;
    for (int i = 0; i <= corners; ++i) {
      const double a = 2 * 3.14159265358979 * (i % corners) / corners;
      paths.add({static_cast<Nm>(std::llround(radius * std::cos(a))), static_cast<Nm>(std::llround(radius * std::sin(a)))},
                PathKind::kContour, 400'000, 4);
    }
    paths.close();
    double length = 0;
    std::vector<double> walked{0};
    for (int i = 0; i < corners; ++i) walked.push_back(length += expand_detail::distance(paths.point[i], paths.point[i + 1]));
    LayerCut cut;
    cut.on = true;
    cut.line.rule = std::array{CutRule::kGrid, CutRule::kThickEnds, CutRule::kAligned}[turn % 3];
    cut.line.thin = 300'000 + random() % 3'000'000;
    cut.line.thick = 300'000 + random() % 3'000'000;
    cut.line.min_end = random() % 2'000'000;
    if (turn % 4 != 0) cut.shift = static_cast<std::int64_t>(random() % 80'000'000) - 40'000'000;
    std::vector<std::pair<Thickness, double>> intervals;
    Point2 begin{}, at{};
    for_each_interval(paths, cut, [&](const PathInterval& s) {
      ASSERT_EQ(s.jump, intervals.empty());
      if (s.jump) begin = s.from;
      if (!s.jump) {
        ASSERT_EQ(s.from, at);
      }
      at = s.to;
      if (intervals.empty() || intervals.back().first != s.thickness) intervals.push_back({s.thickness, 0});
      intervals.back().second += expand_detail::distance(s.from, s.to);
    });
    EXPECT_EQ(at, begin) << "stays closed";
    // It begins where it is stored to begin, or as far along as the shift says.
    const double seam = static_cast<double>(cut.shift) - std::floor(static_cast<double>(cut.shift) / length) * length;
    const auto edge = static_cast<std::size_t>(std::upper_bound(walked.begin(), walked.end() - 1, seam) - walked.begin()) - 1;
    const double along = walked[edge] + expand_detail::distance(paths.point[edge], begin);
    EXPECT_LT(std::min(std::abs(along - seam), length - std::abs(along - seam)), 45)
        << turn;  // whole turns are rounded to 1 nm

    const double slack = 4 + corners;  // ends of stretches are rounded to the nm
    const auto periods = static_cast<std::int64_t>(length / static_cast<double>(cut.line.thin + cut.line.thick));
    ASSERT_EQ(static_cast<std::int64_t>(intervals.size()), 2 * periods + 1) << turn;
    double sum = 0;
    for (std::size_t i = 0; i < intervals.size(); ++i) {
      sum += intervals[i].second;
      ASSERT_EQ(intervals[i].first, i % 2 == 0 ? Thickness::kThick : Thickness::kThin);
      if (periods == 0) continue;
      const double thick = length / static_cast<double>(periods) - static_cast<double>(cut.line.thin);
      const bool end = i == 0 || i + 1 == intervals.size();
      const double expected = i % 2 == 1 ? static_cast<double>(cut.line.thin) : end ? thick / 2 : thick;
      ASSERT_NEAR(intervals[i].second, expected, slack + static_cast<double>(periods)) << turn << ", stretch " << i;
      ASSERT_GE(expected, static_cast<double>(i % 2 == 1 ? cut.line.thin : end ? cut.line.thick / 2 : cut.line.thick) - 1);
    }
    EXPECT_NEAR(sum, length, slack + 2 * static_cast<double>(intervals.size()));
  }
}

}  // namespace
}  // namespace lamina::segment
