// stages/view/picture/canvas.h: an RGB picture on OpenImageIO: boxes, coverage, contours, text, PNG.
#pragma once

#include <OpenImageIO/imagebuf.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/status.h"

namespace lamina::view::picture {

struct Colour {
  std::uint8_t red, green, blue;
};

/// Pixels count from the top left. Shapes are clipped at the canvas.
class Canvas {
 public:
  /// throws  std::bad_alloc
  Canvas(int width, int height, Colour ground);
  Canvas(const Canvas&) = delete;

  int width() const { return width_; }
  int height() const { return height_; }

  void fill_box(int left, int top, int width, int height, Colour colour);

  /// `ink` over what is there, in proportion to shares of 0 .. 255; `width` values a row.
  void paint(int left, int top, int width, std::span<const std::uint8_t> shares, Colour ink);

  /// One line of text, its baseline at `baseline`. Nothing is drawn if the machine has no font (have_font()); what is
  /// not ASCII is drawn as "?" (OpenImageIO 2.4 draws other characters for it).
  void text(int left, int baseline, int size, const std::string& line, Colour colour);

  /// The whole canvas as PNG. errors  kInternal; kMemory
  Result<Buffer<std::byte>> png() const;

 private:
  int width_, height_;
  Buffer<std::uint8_t> bytes_;  // of the pixels: OpenImageIO prints what it cannot allocate
  OIIO::ImageBuf pixels_;
};

/// Whether text can be drawn: DejaVu Sans (Debian's fonts-dejavu-core) is installed.
/// throws  std::system_error: the font cannot be opened for want of memory or open files
bool have_font();

/// Pixels from the start to the end of a line; 0 without a font.
int text_width(const std::string& line, int size);

/// Pixels of a panel: x from its left, y from its top, which lie at `left` and `top` nm.
struct Scale {
  double left, top, pixels_per_nm;
  double x(Nm at) const { return (at - left) * pixels_per_nm; }
  double y(Nm at) const { return (top - at) * pixels_per_nm; }
};

/// Shares of 0 .. 255 of a panel of width x height pixels that lie within contours, by the nonzero rule, to 1/8 of a row.
std::vector<std::uint8_t> contour_shares(const ContoursView& contours, const Scale& scale, int width, int height);

}  // namespace lamina::view::picture
