#include "stages/calibration/scan/extra.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace lamina::scan {
namespace {

constexpr double kAwayMm = 0.5, kLeastMm2 = 1, kLeastShare = 0.5;  // the last of full ink
constexpr double kMostCells = 2000;                                // along an axis

cv::Mat disc_of(double across_cells) {
  const int side = 2 * static_cast<int>(std::ceil(across_cells / 2)) + 1;
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side});
}

/// The image of the layer in cells from its upper left corner.
struct Field {
  double side = 0;  // mm
  cv::Mat light;    // CV_32F; -1 where the photograph does not reach
  cv::Mat wanted;   // CV_8U: something of the cell, or near it, was to be printed
};

Field field_of(const Photo& photo, const ExpectedLayer& layer, const View& view) {
  const double px = layer.pixel_x_nm * 1e-6, py = layer.pixel_y_nm * 1e-6;
  const double wide = layer.image.columns * px, deep = layer.image.rows() * py;
  Field field;
  field.side = std::max(layer.photo_um * 1e-3, std::max(wide, deep) / kMostCells);
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
  field.light = cv::Mat(rows, columns, CV_32F);
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const Spot p = view.at((x + 0.5) * field.side, (y + 0.5) * field.side);
      const bool inside = p.x >= 0 && p.y >= 0 && p.x < photo.light.cols - 1 && p.y < photo.light.rows - 1;
      field.light.at<float>(y, x) = inside ? static_cast<float>(darkness_at(photo.light, p.x, p.y)) : -1.0f;
    }
  }
  return field;
}

/// Darkness against a surface of second degree through the blank cells: those that are dark by it are left out, and it is
/// fitted again.
cv::Mat darkness_by_blank(const Field& field, double ink) {
  constexpr int kRounds = 8;
  using Terms = Eigen::Matrix<double, 6, 1>;
  const cv::Mat& light = field.light;
  const auto terms = [&](int x, int y) {
    const double u = 2.0 * x / light.cols - 1, v = 2.0 * y / light.rows - 1;
    return Terms{{1, u, v, u * u, u * v, v * v}};
  };
  cv::Mat dark = cv::Mat::zeros(light.size(), CV_32F);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Identity() * 1e-9;
    Terms right = Terms::Zero();
    for (int y = 0; y < light.rows; y += 2) {
      for (int x = 0; x < light.cols; x += 2) {
        const double value = static_cast<double>(light.at<float>(y, x));
        if (value < 0 || field.wanted.at<std::uint8_t>(y, x) != 0) continue;
        if (static_cast<double>(dark.at<float>(y, x)) > 0.3 * ink) continue;
        const Terms t = terms(x, y);
        normal += t * t.transpose();
        right += t * value;
      }
    }
    const Terms surface = normal.ldlt().solve(right);
    for (int y = 0; y < light.rows; ++y) {
      for (int x = 0; x < light.cols; ++x) {
        const double value = static_cast<double>(light.at<float>(y, x));
        dark.at<float>(y, x) = value < 0 ? 0.0f : static_cast<float>(1 - value / std::max(surface.dot(terms(x, y)), 1e-3));
      }
    }
  }
  return dark;
}

}  // namespace

std::vector<ExtraInk> extra_ink(const Photo& photo, const ExpectedLayer& layer, const View& view, double ink) {
  const Field field = field_of(photo, layer, view);
  const cv::Mat dark = darkness_by_blank(field, ink);
  cv::Mat soft, found, labels, stats, middles;
  cv::GaussianBlur(dark, soft, {}, 1);
  cv::bitwise_and(soft > kLeastShare * ink, field.wanted == 0, found);
  cv::morphologyEx(found, found, cv::MORPH_OPEN, disc_of(kAwayMm / field.side));
  const int count = cv::connectedComponentsWithStats(found, labels, stats, middles, 8);
  std::vector<ExtraInk> extra;
  for (int i = 1; i < count; ++i) {
    const int left = stats.at<int>(i, cv::CC_STAT_LEFT), top = stats.at<int>(i, cv::CC_STAT_TOP);
    const bool at_edge = left == 0 || top == 0 || left + stats.at<int>(i, cv::CC_STAT_WIDTH) == dark.cols ||
                         top + stats.at<int>(i, cv::CC_STAT_HEIGHT) == dark.rows;
    const double mm2 = field.side * field.side * stats.at<int>(i, cv::CC_STAT_AREA);
    if (at_edge || mm2 < kLeastMm2) continue;
    extra.push_back({(middles.at<double>(i, 0) + 0.5) * field.side, (middles.at<double>(i, 1) + 0.5) * field.side, mm2});
  }
  return extra;
}

}  // namespace lamina::scan
