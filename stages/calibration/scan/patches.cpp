#include "stages/calibration/scan/patches.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace lamina::scan {
namespace {

constexpr std::size_t kMostDiscs = 14, kMostRings = 6;

struct Moments {
  double xx = 0, xy = 0, yy = 0;
};

/// Of the labels that `fits` names, about their middles.
std::vector<Moments> moments_of(const cv::Mat& labels, const cv::Mat& middles, const std::vector<char>& fits) {
  std::vector<Moments> moments(fits.size());
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
  return moments;
}

/// Large ones of the right shape: squares, of 0.955, come after discs.
void keep_likely(std::vector<Patch>& patches, std::size_t most, double fullness) {
  const auto likely = [&](const Patch& p) { return p.area * std::exp(-std::abs(p.fullness - fullness) / 0.02); };
  std::ranges::stable_sort(patches, [&](const Patch& a, const Patch& b) { return likely(a) > likely(b); });
  if (patches.size() > most) patches.resize(most);
}

void add_others(const std::vector<Patch>& more, std::vector<Patch>& patches) {
  const std::size_t before = patches.size();
  for (const Patch& one : more) {
    const bool known = std::any_of(patches.begin(), patches.begin() + static_cast<std::ptrdiff_t>(before), [&](const Patch& p) {
      return std::hypot(p.middle.x - one.middle.x, p.middle.y - one.middle.y) < 0.1 * std::sqrt(p.area);
    });
    if (!known) patches.push_back(one);
  }
}

}  // namespace

Patches find_patches(const Photo& photo, double level, int close) {
  const cv::Mat dark = photo.darkness > level * photo.ink;
  cv::Mat mask = dark, labels, stats, middles;
  if (close > 1) cv::morphologyEx(dark, mask, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_ELLIPSE, {close, close}));
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, middles, 8);
  std::vector<char> fits(static_cast<std::size_t>(count), 0);
  const double most = 0.05 * static_cast<double>(dark.total());
  for (int i = 1; i < count; ++i) {
    const int *s = stats.ptr<int>(i), w = s[cv::CC_STAT_WIDTH], h = s[cv::CC_STAT_HEIGHT];
    const bool inside = s[cv::CC_STAT_LEFT] > 0 && s[cv::CC_STAT_TOP] > 0 && s[cv::CC_STAT_LEFT] + w < dark.cols &&
                        s[cv::CC_STAT_TOP] + h < dark.rows;
    fits[static_cast<std::size_t>(i)] =
        inside && s[cv::CC_STAT_AREA] >= 60 && s[cv::CC_STAT_AREA] <= most && 3 * w > h && 3 * h > w;
  }
  const std::vector<Moments> moments = moments_of(labels, middles, fits);
  Patches patches;
  for (int i = 1; i < count; ++i) {
    if (!fits[static_cast<std::size_t>(i)]) continue;
    const Moments& m = moments[static_cast<std::size_t>(i)];
    const double area = stats.ptr<int>(i)[cv::CC_STAT_AREA], det = (m.xx * m.yy - m.xy * m.xy) / (area * area);
    const double* c = middles.ptr<double>(i);
    const Patch patch{{c[0], c[1]}, area, area / (4 * std::numbers::pi * std::sqrt(std::max(det, 1e-9)))};
    const bool hollow = mask.at<std::uint8_t>(static_cast<int>(std::lround(c[1])), static_cast<int>(std::lround(c[0]))) == 0;
    if (!hollow && patch.fullness > 0.9 && patch.fullness < 1.1) patches.discs.push_back(patch);
    if (hollow && patch.fullness > 0.4 && patch.fullness < 0.8) patches.rings.push_back(patch);
  }
  keep_likely(patches.discs, kMostDiscs, 1);
  keep_likely(patches.rings, kMostRings, 0.6);
  return patches;
}

void add_patches(const Patches& more, Patches& patches) {
  add_others(more.discs, patches.discs);
  add_others(more.rings, patches.rings);
}

}  // namespace lamina::scan
