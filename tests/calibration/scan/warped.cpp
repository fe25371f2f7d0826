#include "tests/calibration/scan/warped.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace lamina::test {
namespace {

/// From cells to pixels of a finer picture, which it is sized for.
cv::Mat warp_of(const InkedSheet& sheet, const Shot& shot, cv::Size& size) {
  const double turn = shot.turn_deg * std::numbers::pi / 180, finer = shot.pixels_a_mm * shot.finer,
               scale = finer / InkedSheet::kCellsAMm;
  const double wide = sheet.cells.cols * scale, high = sheet.cells.rows * scale, c = std::cos(turn), s = std::sin(turn);
  const auto whole = [&](double a, double b) { return static_cast<int>(std::abs(a) + std::abs(b)) / shot.finer * shot.finer; };
  size = {whole(wide * c, high * s), whole(wide * s, high * c)};
  std::array<cv::Point2f, 4> from, to;
  for (int i = 0; i < 4; ++i) {
    const double x = i == 1 || i == 2 ? 1 : 0, y = i / 2, u = (x - 0.5) * wide * (1 - (1 - y) * shot.keystone),
                 v = (y - 0.5) * high;
    // Of OpenCV's whole places, which are the middles of cells.
    from[static_cast<std::size_t>(i)] = {static_cast<float>(x * sheet.cells.cols - 0.5),
                                         static_cast<float>(y * sheet.cells.rows - 0.5)};
    to[static_cast<std::size_t>(i)] = {static_cast<float>(0.5 * size.width + c * u - s * v - 0.5),
                                       static_cast<float>(0.5 * size.height + s * u + c * v - 0.5)};
  }
  return cv::getPerspectiveTransform(from.data(), to.data());
}

/// Yellowish light that falls off to one corner, black that is not quite black, the camera's curve.
cv::Mat coloured(const cv::Mat& share, const Shot& shot) {
  constexpr std::array<double, 3> kPaper{0.84, 0.8, 0.7}, kInk{0.12, 0.1, 0.11};
  cv::Mat picture(share.size(), CV_32FC3);
  for (int y = 0; y < share.rows; ++y) {
    for (int x = 0; x < share.cols; ++x) {
      const double lamp = 1 - 0.2 * x / share.cols - 0.1 * y / share.rows, blank = static_cast<double>(share.at<float>(y, x));
      auto& pixel = picture.at<cv::Vec3f>(y, x);
      for (std::size_t k = 0; k < 3; ++k)
        pixel[static_cast<int>(k)] = static_cast<float>(
            255 * std::pow(std::clamp(lamp * (kInk[k] + (kPaper[k] - kInk[k]) * blank), 0.0, 1.0), 1 / shot.gamma));
    }
  }
  if (shot.noise > 0) {
    cv::Mat noise(picture.size(), picture.type());
    cv::RNG random(shot.seed);
    random.fill(noise, cv::RNG::NORMAL, 0, shot.noise);
    picture += noise;
  }
  cv::Mat bytes;
  picture.convertTo(bytes, CV_8UC3);
  return bytes;
}

}  // namespace

InkedSheet inked_sheet(const RunsView& layer, double pixel_x_mm, double pixel_y_mm,
                       const std::function<std::optional<cv::Point2d>(std::uint32_t)>& shift_mm, double margin_mm) {
  std::uint32_t left = layer.columns, right = 0, top = layer.rows(), bottom = 0;
  for (std::uint32_t r = 0; r < layer.rows(); ++r) {
    const auto row = layer.row(r);
    if (row.empty()) continue;
    left = std::min(left, row.front()), right = std::max(right, row.back());
    top = std::min(top, r), bottom = r + 1;
  }
  InkedSheet sheet{left * pixel_x_mm - margin_mm, top * pixel_y_mm - margin_mm, {}};
  const auto cell = [](double mm) { return static_cast<int>(std::lround(mm * InkedSheet::kCellsAMm)); };
  sheet.cells.create(cell((bottom - top) * pixel_y_mm + 2 * margin_mm), cell((right - left) * pixel_x_mm + 2 * margin_mm),
                     CV_8U);
  sheet.cells.setTo(255);
  for (std::uint32_t r = top; r < bottom; ++r) {
    const auto row = layer.row(r);
    const auto shift = shift_mm(r);
    if (!shift) continue;
    const double y = r * pixel_y_mm - sheet.top_mm + shift->y;
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      const cv::Point a(cell(row[i] * pixel_x_mm - sheet.left_mm + shift->x), cell(y)),
          b(cell(row[i + 1] * pixel_x_mm - sheet.left_mm + shift->x), cell(y + pixel_y_mm));
      sheet.cells(cv::Rect(a, b)).setTo(0);
    }
  }
  return sheet;
}

std::string photograph_to(const std::string& path, const InkedSheet& sheet, const Shot& shot) {
  cv::Size size;
  const cv::Mat warp = warp_of(sheet, shot, size);
  cv::Mat fine, share;
  cv::warpPerspective(sheet.cells, fine, warp, size, shot.interpolation, cv::BORDER_CONSTANT, 255);
  cv::resize(fine, share, {size.width / shot.finer, size.height / shot.finer}, 0, 0, cv::INTER_AREA);
  share.convertTo(share, CV_32F, 1.0 / 255);
  if (shot.blur_pixels > 0) cv::GaussianBlur(share, share, {}, shot.blur_pixels);
  const cv::Mat picture = coloured(share, shot);
  const std::string name = path + (shot.jpeg_quality > 0 ? ".jpg" : ".png");
  const auto file = OIIO::ImageOutput::create(name);
  OIIO::ImageSpec spec(picture.cols, picture.rows, 3, OIIO::TypeDesc::UINT8);
  if (shot.jpeg_quality > 0) spec.attribute("Compression", "jpeg:" + std::to_string(shot.jpeg_quality));
  const bool written =
      file && file->open(name, spec) && file->write_image(OIIO::TypeDesc::UINT8, picture.data) && file->close();
  EXPECT_TRUE(written) << name;
  return name;
}

}  // namespace lamina::test
