#include "stages/scan/marks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace lamina::scan {
namespace {

/// A dark patch. fullness  area / area of the ellipse with its second moments: 1 of a disc, 0.6 of the ring
struct Patch {
  Spot middle;
  double area = 0, fullness = 0;
  bool hollow = false;  // its middle is bright
};

constexpr std::size_t kMostDiscs = 14, kMostRings = 6;
constexpr double kRingShare = 1 - kRingHole * kRingHole;

/// Patches that may be marks. close  pixels of gaps that are bridged: lines of blocked nozzles cut a disc in two
void find_patches(const cv::Mat& dark, int close, std::vector<Patch>& discs, std::vector<Patch>& rings) {
  cv::Mat mask = dark, labels, stats, middles;
  if (close > 1) cv::morphologyEx(dark, mask, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_ELLIPSE, {close, close}));
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, middles, 8);
  struct Moments {
    double xx = 0, xy = 0, yy = 0;
  };
  std::vector<Moments> moments(static_cast<std::size_t>(count));
  std::vector<char> fits(static_cast<std::size_t>(count), 0);
  const double most = 0.05 * static_cast<double>(dark.total());
  for (int i = 1; i < count; ++i) {
    const int *s = stats.ptr<int>(i), w = s[cv::CC_STAT_WIDTH], h = s[cv::CC_STAT_HEIGHT];
    const bool inside = s[cv::CC_STAT_LEFT] > 0 && s[cv::CC_STAT_TOP] > 0 && s[cv::CC_STAT_LEFT] + w < dark.cols &&
                        s[cv::CC_STAT_TOP] + h < dark.rows;
    fits[static_cast<std::size_t>(i)] =
        inside && s[cv::CC_STAT_AREA] >= 60 && s[cv::CC_STAT_AREA] <= most && 3 * w > h && 3 * h > w;
  }
  for (int y = 0; y < labels.rows; ++y) {
    const int* row = labels.ptr<int>(y);
    for (int x = 0; x < labels.cols; ++x) {
      const auto label = static_cast<std::size_t>(row[x]);
      if (!fits[label]) continue;
      const double *c = middles.ptr<double>(row[x]), dx = x - c[0], dy = y - c[1];
      moments[label].xx += dx * dx;
      moments[label].xy += dx * dy;
      moments[label].yy += dy * dy;
    }
  }
  for (int i = 1; i < count; ++i) {
    if (!fits[static_cast<std::size_t>(i)]) continue;
    const Moments& m = moments[static_cast<std::size_t>(i)];
    const double area = stats.ptr<int>(i)[cv::CC_STAT_AREA], det = (m.xx * m.yy - m.xy * m.xy) / (area * area);
    const double* c = middles.ptr<double>(i);
    Patch patch{{c[0], c[1]}, area, area / (4 * std::numbers::pi * std::sqrt(std::max(det, 1e-9))), false};
    patch.hollow = mask.at<std::uint8_t>(static_cast<int>(std::lround(c[1])), static_cast<int>(std::lround(c[0]))) == 0;
    if (!patch.hollow && patch.fullness > 0.9 && patch.fullness < 1.1) discs.push_back(patch);
    if (patch.hollow && patch.fullness > 0.4 && patch.fullness < 0.8) rings.push_back(patch);
  }
}

void keep_largest(std::vector<Patch>& patches, std::size_t most) {
  std::ranges::sort(patches, [](const Patch& a, const Patch& b) { return a.area > b.area; });
  if (patches.size() > most) patches.resize(most);
}

/// How much darker the dashes' places are than the places between them.
double contrast(const Photo& photo, const Chart& chart, const View& view) {
  const std::size_t step = std::max<std::size_t>(1, chart.dashes.size() / 300);
  const double x = chart.scan_along_x ? 0 : chart.between_mm / 2, y = chart.scan_along_x ? chart.between_mm / 2 : 0;
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t d = 0; d < chart.dashes.size(); d += step, ++count) {
    const Spot m = middle_of(chart.dashes[d].box, chart);
    const Spot on = view.at(m.x, m.y), above = view.at(m.x - x, m.y - y), below = view.at(m.x + x, m.y + y);
    sum += darkness_at(photo.darkness, on.x, on.y) -
           0.5 * (darkness_at(photo.darkness, above.x, above.y) + darkness_at(photo.darkness, below.x, below.y));
  }
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

/// The view of a ring and three discs, which follow each other clockwise; false if their sizes do not agree with it.
bool view_of_marks(const Photo& photo, const Chart& chart, const Patch& ring, std::array<Patch, 3> discs, View& view) {
  const Spot middle{(ring.middle.x + discs[0].middle.x + discs[1].middle.x + discs[2].middle.x) / 4,
                    (ring.middle.y + discs[0].middle.y + discs[1].middle.y + discs[2].middle.y) / 4};
  const double first = std::atan2(ring.middle.y - middle.y, ring.middle.x - middle.x);
  const auto turn = [&](const Patch& p) {
    const double angle = std::atan2(p.middle.y - middle.y, p.middle.x - middle.x) - first;
    return angle < 0 ? angle + 2 * std::numbers::pi : angle;
  };
  std::ranges::sort(discs, [&](const Patch& a, const Patch& b) { return turn(a) < turn(b); });
  std::array<Spot, 4> places, pixels{ring.middle, discs[0].middle, discs[1].middle, discs[2].middle};
  for (std::size_t i = 0; i < 4; ++i) {
    places[i] = middle_of(chart.marks[i], chart);
    const Spot a = pixels[i], b = pixels[(i + 1) % 4], c = pixels[(i + 2) % 4];
    if ((b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x) <= 0) return false;
  }
  if (!view_of(places, pixels, photo.grey.cols, photo.grey.rows, view)) return false;
  for (std::size_t i = 0; i < 4; ++i) {
    const double radius = view.pixels_a_mm(places[i].x, places[i].y) * chart.mark_mm;
    const double area = std::numbers::pi * radius * radius * (i == 0 ? kRingShare : 1),
                 seen = i == 0 ? ring.area : discs[i - 1].area;
    if (!(seen > 0.5 * area && seen < 2 * area)) return false;
  }
  return true;
}

}  // namespace

Result<View> find_marks(const Photo& photo, const Chart& chart) {
  cv::Mat dark = photo.darkness > 0.45 * photo.ink;
  View best, view;
  double highest = 0;
  for (const int share : {0, 300, 150, 80}) {
    std::vector<Patch> discs, rings;
    find_patches(dark, share == 0 ? 0 : dark.cols / share, discs, rings);
    keep_largest(discs, kMostDiscs);
    keep_largest(rings, kMostRings);
    for (const Patch& ring : rings) {
      for (std::size_t i = 0; i < discs.size(); ++i) {
        for (std::size_t j = i + 1; j < discs.size(); ++j) {
          for (std::size_t k = j + 1; k < discs.size(); ++k) {
            if (!view_of_marks(photo, chart, ring, {discs[i], discs[j], discs[k]}, view)) continue;
            if (const double got = contrast(photo, chart, view); got > highest) {
              highest = got;
              best = view;
            }
          }
        }
      }
    }
  }
  if (highest > 0.05 * photo.ink) return best;
  return Error{
      Fault::kInput,
      "the chart is not found: its ring and three discs have to be whole in the photograph, which is not mirrored, and "
      "sharp enough to tell its dashes apart"};
}

}  // namespace lamina::scan
