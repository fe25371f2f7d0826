#include "stages/calibration/scan/marks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace lamina::calibration {
namespace {

constexpr double kFaintDash = 0.15;  // of full ink: the contrast of a blurred dash that is read off its middle
constexpr double kRingShare = 1 - kRingHole * kRingHole;

/// In pixels of the photograph.
struct Patch {
  Spot middle;
  double area = 0;
  double fullness = 0;  // area / area of the ellipse with its second moments: 1 of a disc, 0.6 of the ring
};

/// The likeliest of them, whole within the photograph.
struct Patches {
  std::vector<Patch> discs, rings;
};

constexpr std::size_t kMaxDiscs = 14, kMaxRings = 6;

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
void keep_likely(std::vector<Patch>& patches, std::size_t maximum, double fullness) {
  const auto likely = [&](const Patch& p) { return p.area * std::exp(-std::abs(p.fullness - fullness) / 0.02); };
  std::ranges::stable_sort(patches, [&](const Patch& a, const Patch& b) { return likely(a) > likely(b); });
  if (patches.size() > maximum) patches.resize(maximum);
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

/// level  darkness from which on a pixel counts, as a share of full ink
/// close  pixels of gaps that are bridged: lines of blocked nozzles cut a disc in two; 0: none
/// cost   two passes over the photograph
Patches find_patches(const Photo& photo, double level, int close) {
  const cv::Mat dark = photo.darkness > level * photo.ink;
  cv::Mat mask = dark, labels, stats, middles;
  if (close > 1) cv::morphologyEx(dark, mask, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_ELLIPSE, {close, close}));
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, middles, 8);
  std::vector<char> fits(static_cast<std::size_t>(count), 0);
  const double maximum = 0.05 * static_cast<double>(dark.total());
  for (int i = 1; i < count; ++i) {
    const int *s = stats.ptr<int>(i), w = s[cv::CC_STAT_WIDTH], h = s[cv::CC_STAT_HEIGHT];
    const bool inside = s[cv::CC_STAT_LEFT] > 0 && s[cv::CC_STAT_TOP] > 0 && s[cv::CC_STAT_LEFT] + w < dark.cols &&
                        s[cv::CC_STAT_TOP] + h < dark.rows;
    fits[static_cast<std::size_t>(i)] =
        inside && s[cv::CC_STAT_AREA] >= 60 && s[cv::CC_STAT_AREA] <= maximum && 3 * w > h && 3 * h > w;
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
  keep_likely(patches.discs, kMaxDiscs, 1);
  keep_likely(patches.rings, kMaxRings, 0.6);
  return patches;
}

/// Adds patches of another level; those that are there already stay as they are.
void add_patches(const Patches& more, Patches& patches) {
  add_others(more.discs, patches.discs);
  add_others(more.rings, patches.rings);
}

/// A view, and how many of the dashes' places it finds darker than those between them: 1 if all are, about 0 if any place is as
/// good. What is darker than a dash counts as one, so that patches do not make up for dashes that are not there.
struct Best {
  View view;
  double contrast = 0;
};

double contrast_of(const Photo& photo, const Chart& chart, const View& view) {
  const std::size_t step = std::max<std::size_t>(1, chart.dashes.size() / 300);
  const double x = chart.scan_along_x ? 0 : chart.between_mm / 2, y = chart.scan_along_x ? chart.between_mm / 2 : 0;
  const double usual = kFaintDash * photo.ink;
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t d = 0; d < chart.dashes.size(); d += step, ++count) {
    const Spot m = middle_of(chart.dashes[d].box, chart);
    const Spot on = view.at(m.x, m.y), above = view.at(m.x - x, m.y - y), below = view.at(m.x + x, m.y + y);
    const double darker = darkness_at(photo.darkness, on.x, on.y) -
                          0.5 * (darkness_at(photo.darkness, above.x, above.y) + darkness_at(photo.darkness, below.x, below.y));
    sum += std::clamp(darker / usual, -1.0, 1.0);
  }
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

/// The view that has the marks at four pixels, unless they do not follow each other clockwise.
bool view_of_corners(const Photo& photo, const Chart& chart, const std::array<Spot, 4>& pixels, View& view) {
  std::array<Spot, 4> positions;
  for (std::size_t i = 0; i < 4; ++i) {
    positions[i] = middle_of(chart.marks[i], chart);
    const Spot a = pixels[i], b = pixels[(i + 1) % 4], c = pixels[(i + 2) % 4];
    if ((b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x) <= 0) return false;
  }
  return view_of(positions, pixels, photo.grey.cols, photo.grey.rows, view);
}

/// The view of a ring and three discs; false if their sizes do not agree with it.
bool view_of_marks(const Photo& photo, const Chart& chart, const Patch& ring, std::array<Patch, 3> discs, View& view) {
  const Spot middle{(ring.middle.x + discs[0].middle.x + discs[1].middle.x + discs[2].middle.x) / 4,
                    (ring.middle.y + discs[0].middle.y + discs[1].middle.y + discs[2].middle.y) / 4};
  const double first = std::atan2(ring.middle.y - middle.y, ring.middle.x - middle.x);
  const auto turn = [&](const Patch& p) {
    const double angle = std::atan2(p.middle.y - middle.y, p.middle.x - middle.x) - first;
    return angle < 0 ? angle + 2 * std::numbers::pi : angle;
  };
  std::ranges::sort(discs, [&](const Patch& a, const Patch& b) { return turn(a) < turn(b); });
  if (!view_of_corners(photo, chart, {ring.middle, discs[0].middle, discs[1].middle, discs[2].middle}, view)) return false;
  for (std::size_t i = 0; i < 4; ++i) {
    const Spot position = middle_of(chart.marks[i], chart);
    const double radius = view.pixels_a_mm(position.x, position.y) * chart.mark_mm;
    const double area = std::numbers::pi * radius * radius * (i == 0 ? kRingShare : 1),
                 detected = i == 0 ? ring.area : discs[i - 1].area;
    if (!(detected > 0.5 * area && detected < 2 * area)) return false;
  }
  return true;
}

/// The marks without a lens of this strength, about the middle of the photograph.
std::array<Spot, 4> without_lens(const Photo& photo, const std::array<Spot, 4>& pixels, double lens) {
  const Spot m{(photo.grey.cols - 1) / 2.0, (photo.grey.rows - 1) / 2.0};
  const double radius = std::hypot(photo.grey.cols, photo.grey.rows) / 2;
  std::array<Spot, 4> flat = pixels;
  for (std::size_t i = 0; i < 4; ++i) {
    for (int round = 0; round < 4; ++round) {
      const double x = flat[i].x - m.x, y = flat[i].y - m.y, grown = 1 + lens * (x * x + y * y) / (radius * radius);
      flat[i] = {m.x + (pixels[i].x - m.x) / grown, m.y + (pixels[i].y - m.y) / grown};
    }
  }
  return flat;
}

/// Takes a view of four marks, or the same through one of some lenses, if it is better.
void try_lenses(const Photo& photo, const Chart& chart, const View& view, Best& best) {
  std::array<Spot, 4> pixels;
  for (std::size_t i = 0; i < 4; ++i) {
    const Spot position = middle_of(chart.marks[i], chart);
    pixels[i] = view.at(position.x, position.y);
  }
  for (const double lens : {0.0, -0.005, 0.005, -0.01, 0.01}) {
    View through;
    if (!view_of_corners(photo, chart, without_lens(photo, pixels, lens), through)) continue;
    through.lens = lens;
    if (const double got = contrast_of(photo, chart, through); got > best.contrast) best = {through, got};
  }
}

void try_four(const Photo& photo, const Chart& chart, const Patches& patches, Best& best) {
  const std::vector<Patch>& discs = patches.discs;
  View view;
  for (const Patch& ring : patches.rings) {
    for (std::size_t i = 0; i < discs.size(); ++i) {
      for (std::size_t j = i + 1; j < discs.size(); ++j) {
        for (std::size_t k = j + 1; k < discs.size(); ++k) {
          if (!view_of_marks(photo, chart, ring, {discs[i], discs[j], discs[k]}, view)) continue;
          try_lenses(photo, chart, view, best);
        }
      }
    }
  }
}

/// Three marks, the fourth where it would be without perspective. misfit  of shape and sizes, 0 if all agree
struct Guess {
  std::array<Spot, 4> pixels;
  std::size_t missing = 0;
  double misfit = 0;
};

/// detected  the marks but the missing one, in their order
void add_guess(const Chart& chart, std::size_t missing, const std::array<const Patch*, 3>& detected,
               std::vector<Guess>& guesses) {
  constexpr double kMaxAspect = 1.35, kMaxSize = 1.8;
  std::array<std::size_t, 3> marks{};
  for (std::size_t i = 0, m = 0; m < 4; ++m) {
    if (m != missing) marks[i++] = m;
  }
  const Spot o = middle_of(chart.marks[marks[0]], chart), a = middle_of(chart.marks[marks[1]], chart),
             b = middle_of(chart.marks[marks[2]], chart), last = middle_of(chart.marks[missing], chart);
  const double ax = a.x - o.x, ay = a.y - o.y, bx = b.x - o.x, by = b.y - o.y, whole = ax * by - ay * bx;
  if (std::abs(whole) < 1e-6) return;
  const Spot p = detected[0]->middle, q = detected[1]->middle, r = detected[2]->middle;
  const double qx = q.x - p.x, qy = q.y - p.y, rx = r.x - p.x, ry = r.y - p.y;
  // Pixels of a mm of x and of y.
  const Spot x{(qx * by - rx * ay) / whole, (qy * by - ry * ay) / whole},
      y{(rx * ax - qx * bx) / whole, (ry * ax - qy * bx) / whole};
  const double det = x.x * y.y - x.y * y.x, sum = x.x * x.x + x.y * x.y + y.x * y.x + y.y * y.y;
  if (det <= 0) return;
  const double axis_ratio = sum / (2 * det) + std::sqrt(std::max(sum * sum / (4 * det * det) - 1, 0.0));  // of the axes
  if (axis_ratio > kMaxAspect) return;
  Guess guess{{}, missing, std::log(axis_ratio)};
  for (std::size_t i = 0; i < 3; ++i) {
    const double area = std::numbers::pi * chart.mark_mm * chart.mark_mm * det * (marks[i] == 0 ? kRingShare : 1);
    const double off = std::abs(std::log(detected[i]->area / area));
    if (off > std::log(kMaxSize)) return;
    guess.misfit += off;
    guess.pixels[marks[i]] = detected[i]->middle;
  }
  const double dx = last.x - o.x, dy = last.y - o.y;
  guess.pixels[missing] = {p.x + dx * x.x + dy * y.x, p.y + dx * x.y + dy * y.y};
  guesses.push_back(guess);
}

std::vector<Guess> guesses_of(const Chart& chart, const Patches& patches) {
  std::vector<Guess> guesses;
  const std::vector<Patch>& discs = patches.discs;
  for (std::size_t i = 0; i < discs.size(); ++i) {
    for (std::size_t j = 0; j < discs.size(); ++j) {
      if (i == j) continue;
      for (const Patch& ring : patches.rings) {
        for (std::size_t missing = 1; missing < 4; ++missing) add_guess(chart, missing, {&ring, &discs[i], &discs[j]}, guesses);
      }
      for (std::size_t k = 0; k < discs.size(); ++k) {
        if (k != i && k != j) add_guess(chart, 0, {&discs[i], &discs[j], &discs[k]}, guesses);
      }
    }
  }
  std::ranges::stable_sort(guesses, {}, &Guess::misfit);
  return guesses;
}

/// Moves the fourth mark to where the dashes' contrast is highest, by a grid that becomes finer.
Best search_fourth(const Photo& photo, const Chart& chart, Guess guess) {
  const Spot a = guess.pixels[0], c = guess.pixels[2], b = guess.pixels[1], d = guess.pixels[3];
  const double diagonal = 0.5 * (std::hypot(c.x - a.x, c.y - a.y) + std::hypot(d.x - b.x, d.y - b.y));
  View view;
  if (!view_of_corners(photo, chart, guess.pixels, view)) return {};
  const Spot m = middle_of({0, 0, chart.columns, chart.rows}, chart);
  Best best;
  double reach = 0.1 * diagonal, step = 0.35 * chart.between_mm * view.pixels_a_mm(m.x, m.y);
  step = std::max(step, reach / 40);
  for (int round = 0; round < 4; ++round) {
    const Spot from = guess.pixels[guess.missing];
    std::array<Spot, 4> pixels = guess.pixels;
    const int steps = static_cast<int>(std::ceil(reach / step));
    for (int j = -steps; j <= steps; ++j) {
      for (int i = -steps; i <= steps; ++i) {
        pixels[guess.missing] = {from.x + i * step, from.y + j * step};
        if (!view_of_corners(photo, chart, pixels, view)) continue;
        if (const double got = contrast_of(photo, chart, view); got > best.contrast) {
          best = {view, got};
          guess.pixels = pixels;
        }
      }
    }
    reach = step;
    step /= 3;
  }
  return best;
}

}  // namespace

Result<View> find_marks(const Photo& photo, const Chart& chart) {
  constexpr double kMinOfFour = 0.3, kClear = 0.8, kMinOfThree = 0.65;  // shares of dashes
  constexpr double kFaintest = 0.04;                                    // darkness
  constexpr std::size_t kMaxGuesses = 60;
  if (photo.ink < kFaintest)
    return Error{Fault::kInput, "shows nothing dark: photograph the chart on a sheet that its ink darkens"};
  Best best;
  Patches all;
  for (const double level : {0.45, 0.3, 0.6}) {
    for (const int share : {0, 300, 150, 80}) {
      const Patches patches = find_patches(photo, level, share == 0 ? 0 : photo.grey.cols / share);
      try_four(photo, chart, patches, best);
      add_patches(patches, all);
    }
    if (best.contrast > kClear) return best.view;
  }
  // Four marks determine the sheet's orientation; three discs alone may not.
  if (best.contrast > kMinOfFour) return best.view;
  std::vector<Guess> guesses = guesses_of(chart, all);
  if (guesses.size() > kMaxGuesses) guesses.resize(kMaxGuesses);
  Best three;
  for (const Guess& guess : guesses) {
    if (const Best found = search_fourth(photo, chart, guess); found.contrast > three.contrast) three = found;
  }
  if (three.contrast > kMinOfThree) return three.view;
  return Error{Fault::kInput,
               "the chart is not found: the photograph must show three of its ring and discs in full, unmirrored, and "
               "sharp enough to resolve its dashes"};
}

}  // namespace lamina::calibration
