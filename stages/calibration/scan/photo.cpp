#include "stages/calibration/scan/photo.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "stages/data/shortage.h"
#include "stages/support/text/readable.h"

namespace lamina::calibration {
namespace {

constexpr std::int64_t kMaxPixels = 1 << 27;

/// Light of sRGB values (IEC 61966-2-1).
std::array<float, 256> light_table() {
  std::array<float, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double v = static_cast<double>(i) / 255;
    table[i] = static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
  }
  return table;
}

/// The light of the blank sheet: a closing on a small copy takes away what is dark and smaller than a tenth of the picture.
cv::Mat blank_light(const cv::Mat& light) {
  constexpr double kSide = 512;
  const double scale = std::min(1.0, kSide / std::max(light.cols, light.rows));
  cv::Mat small, wide;
  cv::resize(light, small, {}, scale, scale, cv::INTER_AREA);
  const int side = std::max(3, std::max(small.cols, small.rows) / 11) | 1;
  cv::copyMakeBorder(small, wide, side, side, side, side, cv::BORDER_REPLICATE);
  cv::morphologyEx(wide, wide, cv::MORPH_CLOSE, cv::getStructuringElement(cv::MORPH_RECT, {side, side}));
  cv::GaussianBlur(wide, wide, {}, side / 3.0);
  cv::Mat blank;
  cv::resize(wide(cv::Rect(side, side, small.cols, small.rows)), blank, light.size(), 0, 0, cv::INTER_LINEAR);
  return blank;
}

/// Turned as the camera was held. orientation  of Exif and TIFF: 1 as it is
cv::Mat upright(cv::Mat grey, int orientation) {
  if (orientation >= 5 && orientation <= 8) cv::transpose(grey, grey);
  const bool mirrored = orientation == 2 || orientation == 3 || orientation == 6 || orientation == 7;
  const bool upside_down = orientation == 3 || orientation == 4 || orientation == 7 || orientation == 8;
  if (mirrored || upside_down) cv::flip(grey, grey, mirrored && upside_down ? -1 : mirrored ? 1 : 0);
  return grey;
}

}  // namespace

Photo photo_of(cv::Mat grey) {
  static const std::array<float, 256> kLight = light_table();
  Photo photo;
  cv::Mat light(grey.size(), CV_32F);
  for (int y = 0; y < grey.rows; ++y) {
    const auto* from = grey.ptr<std::uint8_t>(y);
    auto* to = light.ptr<float>(y);
    for (int x = 0; x < grey.cols; ++x) to[x] = kLight[from[x]];
  }
  const cv::Mat blank = blank_light(light);
  photo.darkness.create(grey.size(), CV_32F);
  std::array<std::int64_t, 1024> counts{};
  for (int y = 0; y < grey.rows; ++y) {
    const float *from = light.ptr<float>(y), *white = blank.ptr<float>(y);
    auto* to = photo.darkness.ptr<float>(y);
    for (int x = 0; x < grey.cols; ++x) {
      to[x] = 1 - from[x] / std::max(white[x], 1e-4f);
      ++counts[static_cast<std::size_t>(std::clamp(to[x], 0.0f, 0.999f) * 1024)];
    }
  }
  std::int64_t left = static_cast<std::int64_t>(grey.total()) * 3 / 1000;
  std::size_t bin = counts.size() - 1;
  for (; bin > 0 && left >= counts[bin]; --bin) left -= counts[bin];
  photo.ink = static_cast<double>(bin) / 1024;
  photo.light = std::move(light);
  photo.grey = std::move(grey);
  return photo;
}

Result<Photo> read_photo(const std::string& path, int minimum) {
  errno = 0;
  const auto refused = [&](const std::string& why) {
    if (is_shortage(errno)) return shortage(errno, one_line(path));
    return Error{Fault::kInput, fmt::format("{}: {}", one_line(path), one_line(why))};
  };
  const auto file = OIIO::ImageInput::open(path);
  if (!file) return refused("is no photograph that can be read: " + OIIO::geterror());
  const OIIO::ImageSpec& spec = file->spec();
  if (std::int64_t{spec.width} * spec.height > kMaxPixels) return refused("has more than 2^27 pixels; give a smaller one");
  if (std::min(spec.width, spec.height) < minimum)
    return refused(fmt::format("has {} x {} pixels; {} and more a side are needed", spec.width, spec.height, minimum));
  const int channels = spec.nchannels, turn = spec.get_int_attribute("Orientation", 1);
  if (channels < 1 || channels > 4) return refused(fmt::format("has {} channels; give a grey or a colour picture", channels));
  std::vector<std::uint8_t> row(static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(channels));
  std::vector<std::uint8_t> all(row.size() * static_cast<std::size_t>(spec.height));
  if (!file->read_image(0, 0, 0, channels, OIIO::TypeDesc::UINT8, all.data()))
    return refused("cannot be read: " + file->geterror());
  // OpenImageIO multiplies colours by their opacity: what is transparent shows white paper.
  const int alpha = channels % 2 == 0 ? channels - 1 : -1;
  cv::Mat grey(spec.height, spec.width, CV_8U);
  for (int y = 0; y < spec.height; ++y) {
    const std::uint8_t* from = all.data() + static_cast<std::size_t>(y) * row.size();
    auto* to = grey.ptr<std::uint8_t>(y);
    for (int x = 0; x < spec.width; ++x, from += channels) {
      const int detected = channels < 3 ? from[0] : (54 * from[0] + 183 * from[1] + 19 * from[2] + 128) >> 8;  // Rec. 709
      to[x] = static_cast<std::uint8_t>(std::min(255, alpha < 0 ? detected : detected + 255 - from[alpha]));
    }
  }
  return photo_of(upright(std::move(grey), turn));
}

Result<std::string> png_of(const cv::Mat& bgr) {
  std::vector<unsigned char> file;
  OIIO::Filesystem::IOVecOutput memory(file);
  const auto output = OIIO::ImageOutput::create("png");
  if (!output) return Error{Fault::kOutput, "OpenImageIO writes no PNG here"};
  OIIO::ImageSpec spec(bgr.cols, bgr.rows, 3, OIIO::TypeDesc::UINT8);
  spec.attribute("Software", "lamina");
  cv::Mat rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  output->set_ioproxy(&memory);
  if (!output->open("detected.png", spec) || !output->write_image(OIIO::TypeDesc::UINT8, rgb.ptr()) || !output->close())
    return Error{Fault::kOutput, "the picture of the detected marks: " + output->geterror()};
  return std::string(file.begin(), file.end());
}

}  // namespace lamina::calibration
