#include "stages/calibration/scan/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "stages/calibration/robust.h"
#include "stages/geometry/least_squares.h"

namespace lamina::calibration {
namespace {

constexpr double kMinMissingMm = 0.2;
constexpr double kAwayMm = 0.5, kMinMm2 = 1, kMinShare = 0.5;  // of extra ink; the last of full ink
constexpr double kMaxCells = 2000;                             // along an axis of the image that is searched

LayerCells cells_of(const ExpectedLayer& layer) {
  LayerCells cells;
  const double px = layer.pixel_x_nm * 1e-6, py = layer.pixel_y_nm * 1e-6, margin = 2;
  std::uint32_t left = UINT32_MAX, right = 0, top = UINT32_MAX, bottom = 0;
  for (std::uint32_t r = 0; r < layer.image.rows(); ++r) {
    const auto row = layer.image.row(r);
    if (row.empty()) continue;
    left = std::min(left, row.front());
    right = std::max(right, row.back());
    top = std::min(top, r);
    bottom = r + 1;
  }
  if (right <= left) return cells;
  cells.side = layer.photo_um * 1e-3;
  cells.left = left * px - margin;
  cells.top = top * py - margin;
  const int columns = static_cast<int>(((right - left) * px + 2 * margin) / cells.side) + 1;
  const int rows = static_cast<int>(((bottom - top) * py + 2 * margin) / cells.side) + 1;
  if (std::int64_t{columns} * rows > (1 << 26)) return cells;
  cells.share = cv::Mat::zeros(rows, columns, CV_32F);
  const auto overlap = [](double begin, double end, int cell) {
    return std::max(0.0, std::min(end, cell + 1.0) - std::max(begin, static_cast<double>(cell)));
  };
  for (std::uint32_t r = top; r < bottom; ++r) {
    const double t = (r * py - cells.top) / cells.side, b = ((r + 1) * py - cells.top) / cells.side;
    const auto row = layer.image.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      const double l = (row[i] * px - cells.left) / cells.side, e = (row[i + 1] * px - cells.left) / cells.side;
      for (int y = static_cast<int>(t); y < b && y < rows; ++y) {
        auto* to = cells.share.ptr<float>(y);
        const double high = overlap(t, b, y);
        for (int x = static_cast<int>(l); x < e && x < columns; ++x) to[x] += static_cast<float>(high * overlap(l, e, x));
      }
    }
  }
  return cells;
}

/// Darkness against the light of blank cells, to which a surface of second degree is fitted. In further rounds those that are
/// darker by it than `most` are left out. light  CV_32F, below 0 where it is not known: dark is 0 there
cv::Mat darkness_of(const cv::Mat& light, const cv::Mat& blank, int rounds, double maximum) {
  const auto terms = [&](int x, int y) {
    const double u = 2.0 * x / light.cols - 1, v = 2.0 * y / light.rows - 1;
    return std::array{1.0, u, v, u * u, u * v, v * v};
  };
  cv::Mat dark = cv::Mat::zeros(light.size(), CV_32F);
  for (int round = 0; round < rounds; ++round) {
    LeastSquares linear(6);
    for (int y = 0; y < light.rows; y += 2) {
      for (int x = 0; x < light.cols; x += 2) {
        const double value = static_cast<double>(light.at<float>(y, x));
        if (value < 0 || blank.at<std::uint8_t>(y, x) == 0 || static_cast<double>(dark.at<float>(y, x)) > maximum) continue;
        linear.add(terms(x, y), value);
      }
    }
    linear.damp(0, 1e-9);
    std::array<double, 6> surface{};
    if (!linear.solve(surface)) return dark;
    for (int y = 0; y < light.rows; ++y) {
      for (int x = 0; x < light.cols; ++x) {
        const double value = static_cast<double>(light.at<float>(y, x));
        const auto at = terms(x, y);
        const double blank_light = std::inner_product(at.begin(), at.end(), surface.begin(), 0.0);
        dark.at<float>(y, x) = value < 0 ? 0.0f : static_cast<float>(1 - value / std::max(blank_light, 1e-3));
      }
    }
  }
  return dark;
}

/// Stripes of cells along the scan that are much brighter than ink. full  cells that are to be printed, away from edges
std::vector<MissingBand> missing_bands(const cv::Mat& dark, const cv::Mat& full, const LayerCells& layer, bool along_x,
                                       double ink) {
  constexpr int kMinCells = 15;
  const int count = along_x ? dark.rows : dark.cols, length = along_x ? dark.cols : dark.rows;
  std::vector<double> ratio(static_cast<std::size_t>(count), 1);
  for (int i = 0; i < count; ++i) {
    double sum = 0;
    int cells = 0;
    for (int k = 0; k < length; ++k) {
      const int x = along_x ? k : i, y = along_x ? i : k;
      if (full.at<std::uint8_t>(y, x) == 0) continue;
      sum += static_cast<double>(dark.at<float>(y, x));
      ++cells;
    }
    if (cells >= kMinCells) ratio[static_cast<std::size_t>(i)] = sum / cells / ink;
  }
  std::vector<MissingBand> bands;
  const double start = along_x ? layer.top : layer.left;
  for (int i = 0; i < count; ++i) {
    if (ratio[static_cast<std::size_t>(i)] > 0.7) continue;
    int first = i, last = i;
    while (first > 0 && ratio[static_cast<std::size_t>(first - 1)] < 0.93) --first;
    while (last + 1 < count && ratio[static_cast<std::size_t>(last + 1)] < 0.93) ++last;
    double missing = 0;
    for (int k = first; k <= last; ++k) missing += (1 - ratio[static_cast<std::size_t>(k)]) * layer.side;
    if (missing >= kMinMissingMm) bands.push_back({start + first * layer.side, start + (last + 1) * layer.side, missing});
    i = last;
  }
  return bands;
}

std::vector<BodyReading> bodies_of(const cv::Mat& dark, const LayerCells& layer, double ink) {
  cv::Mat labels, near, grown = layer.share > 0.5;
  const int count = cv::connectedComponents(grown, labels, 8);
  std::vector<BodyReading> bodies(static_cast<std::size_t>(std::max(count - 1, 0)));
  std::vector<double> cells(bodies.size(), 0);
  // Each body with what lies up to three cells around it and nearer to no other one.
  for (int round = 0; round < 3; ++round) {
    cv::Mat wider = labels.clone();
    for (int y = 1; y + 1 < labels.rows; ++y) {
      for (int x = 1; x + 1 < labels.cols; ++x) {
        if (labels.at<int>(y, x) != 0) continue;
        for (const auto& [i, j] : {std::pair(0, -1), {-1, 0}, {1, 0}, {0, 1}}) {
          if (wider.at<int>(y, x) == 0) wider.at<int>(y, x) = labels.at<int>(y + j, x + i);
        }
      }
    }
    labels = wider;
  }
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const int label = labels.at<int>(y, x);
      if (label == 0) continue;
      BodyReading& body = bodies[static_cast<std::size_t>(label - 1)];
      const double area = layer.side * layer.side, share = static_cast<double>(layer.share.at<float>(y, x));
      const Spot m = layer.middle(x, y);
      body.expected_mm2 += area * share;
      body.detected_mm2 += area * std::clamp(static_cast<double>(dark.at<float>(y, x)) / ink, 0.0, 1.0);
      body.x_mm += m.x;
      body.y_mm += m.y;
      ++cells[static_cast<std::size_t>(label - 1)];
    }
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    bodies[b].x_mm /= std::max(cells[b], 1.0);
    bodies[b].y_mm /= std::max(cells[b], 1.0);
  }
  return bodies;
}

cv::Mat disc_of(double across_cells) {
  const int side = 2 * static_cast<int>(std::ceil(across_cells / 2)) + 1;
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side});
}

/// The image of the layer in cells from its upper left corner.
struct ColourField {
  double side = 0;  // mm
  cv::Mat light;    // CV_32F; -1 where the photograph does not reach
  cv::Mat wanted;   // CV_8U: something of the cell, or near it, was to be printed
};

ColourField field_of(const Photo& photo, const ExpectedLayer& layer, const View& view) {
  const double px = layer.pixel_x_nm * 1e-6, py = layer.pixel_y_nm * 1e-6;
  const double wide = layer.image.columns * px, deep = layer.image.rows() * py;
  ColourField field;
  field.side = std::max(layer.photo_um * 1e-3, std::max(wide, deep) / kMaxCells);
  const int columns = static_cast<int>(wide / field.side) + 1, rows = static_cast<int>(deep / field.side) + 1;
  field.wanted = cv::Mat::zeros(rows, columns, CV_8U);
  for (std::uint32_t r = 0; r < layer.image.rows(); ++r) {
    const auto row = layer.image.row(r);
    const int top = static_cast<int>(r * py / field.side), bottom = static_cast<int>((r + 1) * py / field.side);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      const int left = static_cast<int>(row[i] * px / field.side), right = static_cast<int>(row[i + 1] * px / field.side);
      for (int y = top; y <= std::min(bottom, rows - 1); ++y)
        std::fill(field.wanted.ptr(y) + left, field.wanted.ptr(y) + std::min(right + 1, columns), std::uint8_t{1});
    }
  }
  cv::dilate(field.wanted, field.wanted, disc_of(2 * kAwayMm / field.side));
  field.light = in_cells(photo.light, {field.wanted, 0, 0, field.side}, view, -1);
  return field;
}

/// Connected dark areas of a square millimetre and more, half a millimetre wide and more, of half of full ink and more, half a
/// millimetre away from what was to be printed. Searched wherever the photograph shows the image of the layer; an area that
/// reaches the image's edge is taken for the edge of the bed.
/// view  of the photograph
/// ink   darkness of full ink, of the light of the blank sheet
/// cost  O(cells of the image, 4 million at most)
std::vector<ExtraInk> extra_ink(const Photo& photo, const ExpectedLayer& layer, const View& view, double ink) {
  const ColourField field = field_of(photo, layer, view);
  const cv::Mat dark = darkness_of(field.light, field.wanted == 0, 8, 0.3 * ink);
  cv::Mat soft, found, labels, stats, middles;
  cv::GaussianBlur(dark, soft, {}, 1);
  cv::bitwise_and(soft > kMinShare * ink, field.wanted == 0, found);
  cv::morphologyEx(found, found, cv::MORPH_OPEN, disc_of(kAwayMm / field.side));
  const int count = cv::connectedComponentsWithStats(found, labels, stats, middles, 8);
  std::vector<ExtraInk> extra;
  for (int i = 1; i < count; ++i) {
    const int left = stats.at<int>(i, cv::CC_STAT_LEFT), top = stats.at<int>(i, cv::CC_STAT_TOP);
    const bool at_edge = left == 0 || top == 0 || left + stats.at<int>(i, cv::CC_STAT_WIDTH) == dark.cols ||
                         top + stats.at<int>(i, cv::CC_STAT_HEIGHT) == dark.rows;
    const double mm2 = field.side * field.side * stats.at<int>(i, cv::CC_STAT_AREA);
    if (at_edge || mm2 < kMinMm2) continue;
    extra.push_back({(middles.at<double>(i, 0) + 0.5) * field.side, (middles.at<double>(i, 1) + 0.5) * field.side, mm2});
  }
  return extra;
}

}  // namespace

Result<Comparison> compare_layer(const Photo& photo, const ExpectedLayer& layer) {
  constexpr double kMinLikeness = 0.6, kClearly = 0.02;
  const LayerCells cells = cells_of(layer);
  if (cells.share.empty())
    return Error{Fault::kInput,
                 "cannot be compared: the layer is empty, or too large for pixels of the size that --pixel says"};
  const LayerPosition position = locate_layer(photo.light, cells);
  if (position.mirrored_likeness >= kMinLikeness && position.mirrored_likeness > position.likeness + kClearly)
    return Error{Fault::kInput, "is a mirror image of the layer; flip the picture, or photograph the layer from above"};
  if (position.likeness < kMinLikeness)
    return Error{Fault::kInput,
                 fmt::format("does not show the layer (correlation {:.2f}, at least {} is needed): photograph it from above, "
                             "with a pixel size within 5 % of --pixel",
                             std::max(position.likeness, 0.0), kMinLikeness)};
  Comparison comparison{position, {}, {}, {}};
  cv::Mat blank, full;
  cv::dilate(cells.share > 0.01, blank, disc_of(8));
  blank = blank == 0;
  cv::erode(cells.share > 0.99, full, disc_of(4));
  const cv::Mat dark = darkness_of(in_cells(photo.light, cells, position.view, -1), blank, 1, 1);
  std::vector<float> inked;
  for (int y = 0; y < dark.rows; ++y) {
    for (int x = 0; x < dark.cols; ++x) {
      if (full.at<std::uint8_t>(y, x) != 0) inked.push_back(dark.at<float>(y, x));
    }
  }
  if (inked.empty())
    return Error{Fault::kInput,
                 "cannot be compared: the layer has no fully printed area several pixels of the photograph wide to measure the "
                 "darkness of ink; if it is dithered, use the layer of a job without --saturation"};
  const double ink = upper_median_of(inked);
  if (ink < 0.05)
    return Error{Fault::kInput, "shows no ink where the layer has some: less than a twentieth darker than the blank sheet"};
  comparison.bands = missing_bands(dark, full, cells, layer.scan_along_x, ink);
  comparison.bodies = bodies_of(dark, cells, ink);
  comparison.extra = extra_ink(photo, layer, position.view, ink);
  return comparison;
}

}  // namespace lamina::calibration
