#include "stages/view/picture/canvas.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>

namespace lamina::view::picture {
namespace {

constexpr const char* kFont = "DejaVuSans";  // found by OpenImageIO in the system's font folders

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

}  // namespace

Canvas::Canvas(int width, int height, Colour ground)
    : width_(width), height_(height), pixels_(OIIO::ImageSpec(width, height, 3, OIIO::TypeDesc::UINT8)) {
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
  OIIO::ImageBufAlgo::render_text(pixels_, left, baseline, ascii(line), size, kFont, channels);
}

Result<Buffer<std::byte>> Canvas::png() const {
  const auto failure = [](const std::string& why) {
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
    const bool measured = OIIO::ImageBufAlgo::text_size("0", 16, kFont).defined();
    if (!measured) OIIO::geterror();  // taken, so that it is not printed at the end of the program
    return measured;
  }();
  return found;
}

int text_width(const std::string& line, int size) {
  if (!have_font()) return 0;
  const OIIO::ROI box = OIIO::ImageBufAlgo::text_size(ascii(line), size, kFont);
  return box.defined() ? box.xend : 0;
}

}  // namespace lamina::view::picture
