// stages/view/picture/canvas.h: an RGB picture on OpenImageIO: boxes, coverage, text, PNG.
#pragma once

#include <OpenImageIO/imagebuf.h>

#include <cstdint>
#include <span>
#include <string>

#include "stages/data/buffer.h"
#include "stages/data/status.h"

namespace lamina::view::picture {

struct Colour {
  std::uint8_t red, green, blue;
};

/// Pixels count from the top left. Whatever reaches beyond the canvas is cut off.
class Canvas {
 public:
  Canvas(int width, int height, Colour ground);

  int width() const { return width_; }
  int height() const { return height_; }

  void fill_box(int left, int top, int width, int height, Colour colour);

  /// `ink` over what is there, in proportion to shares of 0 .. 255; `width` values a row.
  void paint(int left, int top, int width, std::span<const std::uint8_t> shares, Colour ink);

  /// One line of text, its baseline at `baseline`. Nothing is drawn if the machine has no font (have_font()); what is
  /// not ASCII is drawn as "?" (OpenImageIO 2.4 draws other characters for it).
  void text(int left, int baseline, int size, const std::string& line, Colour colour);

  /// The whole canvas as PNG. errors  kInternal
  Result<Buffer<std::byte>> png() const;

 private:
  int width_, height_;
  OIIO::ImageBuf pixels_;
};

/// Whether text can be drawn: DejaVu Sans (Debian's fonts-dejavu-core) is installed.
bool have_font();

/// Pixels from the start to the end of a line; 0 without a font.
int text_width(const std::string& line, int size);

}  // namespace lamina::view::picture
