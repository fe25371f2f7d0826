// stages/formats/svg/svg_writer.h: the elements of an SVG file, one a line, indented by a tab for each element around them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"

namespace lamina::formats {

/// The picture's frame: x from the left of what is shown, y downwards from its back; nm on the bed.
struct SvgFrame {
  std::int64_t left, back;
};

/// Text between tags, in attributes and in comments: what XML reserves is escaped, control characters are left out.
std::string svg_escaped(std::string_view text);

/// Appends to a buffer. An element is begin(), its attributes, then end() or open() ... close() or text().
class SvgWriter {
 public:
  /// depth  of the next element: 0 for <svg> itself
  explicit SvgWriter(Buffer<char>& out, int depth = 0) : out_(out), depth_(depth) {}

  void begin(std::string_view element);
  void attribute(std::string_view name, std::string_view value);  // svg_escaped() where it may hold what XML reserves
  void number(std::string_view name, double value);               // two decimals
  void millimetres(std::string_view name, std::int64_t nm, std::string_view unit = {});

  /// The attribute "d" of a path: begin_data(), any number of line() and contour(), end_data(). Exact, in mm.
  void begin_data();
  void line(std::span<const Point2> points, const SvgFrame& frame) { put_points(points, frame, false); }
  void contour(std::span<const Point2> points, const SvgFrame& frame) { put_points(points, frame, true); }
  void end_data();

  void comment(std::string_view text);  // escaped
  void end();                           // of an element without content
  void open();                          // its content follows
  void close(std::string_view element);
  void text(std::string_view line, std::string_view element);  // the content is one line; ends the element

 private:
  void indent() { out_.insert(out_.end(), static_cast<std::size_t>(depth_), '\t'); }
  void put_points(std::span<const Point2> points, const SvgFrame& frame, bool closed);

  Buffer<char>& out_;
  int depth_;
};

}  // namespace lamina::formats
