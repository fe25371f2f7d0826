#include "stages/view/picture/canvas.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "stages/data/shortage.h"

namespace lamina::view::picture {
namespace {

/// The font's file in the folders of Debian, Fedora and Arch; its name otherwise, by which OpenImageIO 2.4 searches all font
/// folders of the system, and 2.5 some.
const std::string& font() {
  static const std::string found = [] {
    for (const char* folder : {"truetype/dejavu", "dejavu-sans-fonts", "dejavu", "TTF"}) {
      std::error_code error;
      std::string file = fmt::format("/usr/share/fonts/{}/DejaVuSans.ttf", folder);
      if (std::filesystem::is_regular_file(file, error)) return file;
    }
    return std::string("DejaVuSans");
  }();
  return found;
}

/// One "?" for each character of UTF-8 that is not printable ASCII.
std::string ascii(const std::string& line) {
  std::string plain;
  for (const char c : line) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xC0) == 0x80) continue;
    plain += byte >= 0x20 && byte < 0x7F ? c : '?';
  }
  return plain;
}

/// Of memory or open files in OpenImageIO, if errno states one.
void throw_shortage() {
  if (is_shortage(errno)) throw std::system_error(errno, std::generic_category());
}

constexpr int kSubrows = 8;

/// Adds to `share` how much of each pixel of a row of pixels [from, to) covers, times `weight`.
void add_span(double from, double to, double weight, std::vector<double>& share) {
  from = std::clamp(from, 0.0, static_cast<double>(share.size()));
  to = std::clamp(to, 0.0, static_cast<double>(share.size()));
  if (from >= to) return;
  const auto first = static_cast<std::size_t>(from), last = std::min(static_cast<std::size_t>(to), share.size() - 1);
  if (first == last) {
    share[first] += (to - from) * weight;
    return;
  }
  share[first] += (static_cast<double>(first) + 1 - from) * weight;
  for (std::size_t i = first + 1; i < last; ++i) share[i] += weight;
  share[last] += (to - static_cast<double>(last)) * weight;
}

}  // namespace

Canvas::Canvas(int width, int height, Colour ground)
    : width_(width),
      height_(height),
      bytes_(std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height)),
      pixels_(OIIO::ImageSpec(width, height, 3, OIIO::TypeDesc::UINT8), bytes_.data()) {
  pixels_.specmod().attribute("Software", "lamina");
  fill_box(0, 0, width, height, ground);
}

void Canvas::fill_box(int left, int top, int width, int height, Colour colour) {
  const int right = std::min(left + width, width_), bottom = std::min(top + height, height_);
  left = std::max(left, 0);
  for (int y = std::max(top, 0); y < bottom; ++y) {
    auto* pixel = static_cast<std::uint8_t*>(pixels_.pixeladdr(left, y));
    for (int x = left; x < right; ++x, pixel += 3) {
      pixel[0] = colour.red;
      pixel[1] = colour.green;
      pixel[2] = colour.blue;
    }
  }
}

void Canvas::paint(int left, int top, int width, std::span<const std::uint8_t> shares, Colour ink) {
  const int rows = static_cast<int>(shares.size()) / width;
  const auto over = [](std::uint8_t below, std::uint8_t above, unsigned share) {
    return static_cast<std::uint8_t>((below * (255 - share) + above * share + 127) / 255);
  };
  for (int y = 0; y < rows && top + y < height_; ++y) {
    const std::uint8_t* share = shares.data() + static_cast<std::ptrdiff_t>(y) * width;
    auto* pixel = static_cast<std::uint8_t*>(pixels_.pixeladdr(left, top + y));
    for (int x = 0; x < std::min(width, width_ - left); ++x, pixel += 3) {
      pixel[0] = over(pixel[0], ink.red, share[x]);
      pixel[1] = over(pixel[1], ink.green, share[x]);
      pixel[2] = over(pixel[2], ink.blue, share[x]);
    }
  }
}

void Canvas::text(int left, int baseline, int size, const std::string& line, Colour colour) {
  if (!have_font()) return;
  const float channels[3] = {static_cast<float>(colour.red) / 255, static_cast<float>(colour.green) / 255,
                             static_cast<float>(colour.blue) / 255};
  errno = 0;
  if (!OIIO::ImageBufAlgo::render_text(pixels_, left, baseline, ascii(line), size, font(), channels)) throw_shortage();
}

Result<Buffer<std::byte>> Canvas::png() const {
  errno = 0;
  const auto failure = [](const std::string& why) {
    if (is_shortage(errno)) return shortage(errno);
    return Error{Fault::kInternal, fmt::format("the picture cannot be encoded: {}", why)};
  };
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create("sheet.png");
  if (output == nullptr) return failure(OIIO::geterror());
  Buffer<std::byte> bytes;
  std::vector<unsigned char> file;
  OIIO::Filesystem::IOVecOutput memory(file);
  output->set_ioproxy(&memory);
  if (!output->open("sheet.png", pixels_.spec()) || !pixels_.write(output.get()) || !output->close()) {
    return failure(output->has_error() ? output->geterror() : pixels_.geterror());
  }
  const auto* begin = reinterpret_cast<const std::byte*>(file.data());
  bytes.assign(begin, begin + file.size());
  return bytes;
}

bool have_font() {
  static const bool found = [] {
    errno = 0;
    const bool measured = OIIO::ImageBufAlgo::text_size("0", 16, font()).defined();
    if (!measured) throw_shortage();
    if (!measured) OIIO::geterror();  // taken, so that it is not printed at the end of the program
    return measured;
  }();
  return found;
}

int text_width(const std::string& line, int size) {
  if (!have_font()) return 0;
  const OIIO::ROI box = OIIO::ImageBufAlgo::text_size(ascii(line), size, font());
  return box.defined() ? box.xend : 0;
}

std::vector<std::uint8_t> contour_shares(const ContoursView& contours, const Scale& scale, int width, int height) {
  struct Crossing {
    float x;
    int turn;
  };
  std::vector<std::vector<Crossing>> crossings(static_cast<std::size_t>(height) * kSubrows);
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 a = contours[c].back();
    for (const Point2 b : contours[c]) {
      double ax = scale.x(a.x), ay = scale.y(a.y), bx = scale.x(b.x), by = scale.y(b.y);
      const int turn = ay < by ? 1 : -1;
      a = b;
      if (ay > by) std::swap(ax, bx), std::swap(ay, by);
      const auto row = [&](double y) {
        return static_cast<long>(std::clamp(std::ceil(y * kSubrows - 0.5), 0.0, static_cast<double>(crossings.size())));
      };
      for (long r = row(ay); r < row(by); ++r) {
        const double y = (static_cast<double>(r) + 0.5) / kSubrows;
        crossings[static_cast<std::size_t>(r)].push_back({static_cast<float>(ax + (bx - ax) * (y - ay) / (by - ay)), turn});
      }
    }
  }
  std::vector<std::uint8_t> shares(static_cast<std::size_t>(width) * height);
  std::vector<double> share;
  for (int y = 0; y < height; ++y) {
    share.assign(static_cast<std::size_t>(width), 0);
    for (int s = 0; s < kSubrows; ++s) {
      auto& row = crossings[static_cast<std::size_t>(y) * kSubrows + s];
      std::ranges::sort(row, {}, &Crossing::x);
      int winding = 0;
      double begin = 0;
      for (const Crossing& crossing : row) {
        if (winding == 0) begin = crossing.x;
        winding += crossing.turn;
        if (winding == 0) add_span(begin, crossing.x, 1.0 / kSubrows, share);
      }
    }
    for (int x = 0; x < width; ++x) {
      shares[static_cast<std::size_t>(y) * width + x] =
          static_cast<std::uint8_t>(std::clamp(share[static_cast<std::size_t>(x)] * 255 + 0.5, 0.0, 255.0));
    }
  }
  return shares;
}

}  // namespace lamina::view::picture
