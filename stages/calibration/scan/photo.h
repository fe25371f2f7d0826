// stages/calibration/scan/photo.h: photographs as darkness. These are the sources of lamina-scan, the one program that needs
// OpenCV.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::calibration {

/// Darkness of each pixel, 0 as bright as its surroundings, 1 black: 1 - light / light of the blank sheet there.
struct Photo {
  cv::Mat darkness;  // CV_32F
  cv::Mat light;     // CV_32F, 0 .. 1
  cv::Mat grey;      // CV_8U, as it was
  double ink = 0;    // darkness of full ink: what three pixels in a thousand exceed
};

/// Reads PNG, JPEG, TIFF and any other format of OpenImageIO; values count as sRGB, colours by their luminance, transparent
/// pixels as white. Rotated by the camera orientation that the file states.
/// minimum  pixels of the shorter side
/// errors  kInput: no such image, smaller, or more than 2^27 pixels
/// cost    reads the image; 13 bytes a pixel
Result<Photo> read_photo(const std::string& path, int minimum);

/// The same of grey values in memory.
Photo photo_of(cv::Mat grey);

/// Darkness between pixels, bilinear; 0 outside. x, y  pixel centres are whole
inline double darkness_at(const cv::Mat& darkness, double x, double y) {
  if (!(x >= 0 && y >= 0 && x < darkness.cols - 1 && y < darkness.rows - 1)) return 0;  // nor is NaN inside
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const double u = x - i, v = y - j;
  const float *above = darkness.ptr<float>(j), *below = darkness.ptr<float>(j + 1);
  return (1 - v) * ((1 - u) * static_cast<double>(above[i]) + u * static_cast<double>(above[i + 1])) +
         v * ((1 - u) * static_cast<double>(below[i]) + u * static_cast<double>(below[i + 1]));
}

/// A colour picture of the photograph in memory as PNG. bgr  CV_8UC3. errors  kOutput
Result<std::string> png_of(const cv::Mat& bgr);

}  // namespace lamina::calibration
