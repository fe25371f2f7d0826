#include "stages/write/picture/drawing.h"

#include <fmt/format.h>

#include <sstream>

#include "stages/write/picture/canvas.h"

namespace lamina::write::picture {
namespace {

constexpr int kMostPixels = 20'000;

bool read_colour(std::istream& words, Colour& colour) {
  std::string text;
  if (!(words >> text) || text.size() != 6 || text.find_first_not_of("0123456789abcdef") != std::string::npos) return false;
  const unsigned long all = std::stoul(text, nullptr, 16);
  colour = {static_cast<std::uint8_t>(all >> 16), static_cast<std::uint8_t>(all >> 8), static_cast<std::uint8_t>(all)};
  return true;
}

bool draw(Canvas& canvas, const std::string& kind, std::istream& words) {
  Colour colour{};
  if (kind == "box") {
    int left, top, width, height;
    if (!(words >> left >> top >> width >> height) || !read_colour(words, colour)) return false;
    canvas.fill_box(left, top, width, height, colour);
    return true;
  }
  int x, baseline, size;
  std::string anchor, line;
  if (kind != "text" || !(words >> x >> baseline >> size >> anchor) || !read_colour(words, colour)) return false;
  words.get();
  std::getline(words, line);
  const int width = text_width(line, size);
  canvas.text(anchor == "end" ? x - width : anchor == "middle" ? x - width / 2 : x, baseline, size, line, colour);
  return true;
}

}  // namespace

Result<Buffer<std::byte>> drawing_png(const std::string& text) {
  std::istringstream lines(text);
  std::string line, kind;
  int number = 1, width = 0, height = 0;
  const auto wrong = [&] { return Error{Fault::kUsage, fmt::format("line {} is no part of a drawing", number)}; };
  std::getline(lines, line);
  std::istringstream head(line);
  if (!(head >> kind >> width >> height) || kind != "drawing" || width < 1 || height < 1 || width > kMostPixels ||
      height > kMostPixels) {
    return wrong();
  }
  Canvas canvas(width, height, {255, 255, 255});
  while (std::getline(lines, line)) {
    ++number;
    std::istringstream words(line);
    words >> kind;
    if (!draw(canvas, kind, words)) return wrong();
  }
  return canvas.png();
}

}  // namespace lamina::write::picture
