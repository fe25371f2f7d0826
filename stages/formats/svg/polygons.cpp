// stages/formats/svg/polygons.cpp: slices as Slic3r 1.3 writes them with --export-svg, byte for byte but for the comment, since
// the hosts of powder printers that read them look at lines; see README.md for each. source  slic3r/Slic3r, tag 1.3.0
// (3ba8e0f), lib/Slic3r/Print.pm, export_svg
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "stages/formats/slice_format.h"
#include "stages/formats/svg/svg_writer.h"
#include "stages/support/text/decimal.h"

namespace lamina::write {
namespace {

/// A length as Perl prints it: mm, below 0.0001 with an exponent.
char* put_perl_mm(std::int64_t nm, char* out) {
  if (nm == 0 || std::abs(nm) >= 100) return put_mm(nm, out);
  return fmt::format_to(out, "{:.15g}", mm(nm));
}

std::string perl_mm(std::int64_t nm) {
  char text[kMostDecimal];
  return {text, put_perl_mm(nm, text)};
}

/// An outer contour and the holes in it, contours [first, end).
struct Outline {
  __int128 area;  // doubled, nm^2, of the outer contour
  std::uint32_t first, end;
};

/// The outlines of all bodies, those around others first: readers that paint in order would clear islands with the hole
/// that they lie in. What lies within a hole has less area. A layer without holes keeps its order. cost  O(points + n log n)
std::vector<Outline> outermost_first(const ContoursView& contours) {
  std::vector<Outline> outlines;
  bool holes = false;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    const __int128 area = doubled_area(contours[c]);
    if (area > 0 || outlines.empty()) {
      outlines.push_back({area, c, c + 1});
    } else {
      outlines.back().end = c + 1;
      holes = true;
    }
  }
  const auto larger = [](const Outline& a, const Outline& b) { return a.area > b.area; };
  if (holes) std::stable_sort(outlines.begin(), outlines.end(), larger);
  return outlines;
}

class SvgPolygonEncoder : public SliceEncoder {
 public:
  void head(const SliceHead& head, Buffer<char>& out) const override {
    append(out,
           "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n"
           "<!DOCTYPE svg PUBLIC \"-//W3C//DTD SVG 1.0//EN\" \"http://www.w3.org/TR/2001/REC-SVG-20010904/DTD/svg10.dtd\">\n");
    append(out, fmt::format("<svg width=\"{}\" height=\"{}\" xmlns=\"http://www.w3.org/2000/svg\" "
                            "xmlns:svg=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" "
                            "xmlns:slic3r=\"http://slic3r.org/namespaces/slic3r\">\n  <!-- \n  Generated using {}\n   -->\n",
                            perl_mm(head.bounds.width()), perl_mm(head.bounds.depth()), svg_escaped(head.program)));
  }

  void layer(const SliceHead& head, const SliceLayer& layer, Buffer<char>& out) const override {
    // The height of the plane in kilometres: Slic3r turns it into mm once too often, and readers undo that.
    append(out, fmt::format("  <g id=\"layer{}\" slic3r:z=\"{:.15g}\">\n", layer.layer.index, mm(layer.layer.plane()) * 1e-6));
    for (const Outline& outline : outermost_first(layer.contours)) {
      for (std::uint32_t c = outline.first; c < outline.end; ++c) put_polygon(head.bounds, layer.contours[c], out);
    }
    append(out, "  </g>\n");
  }

  void tail(const SliceHead&, Buffer<char>& out) const override { append(out, "</svg>\n"); }

 private:
  /// x from the left of the box, y from its front: upwards, though pictures count downwards.
  static void put_polygon(const Box& box, std::span<const Point2> contour, Buffer<char>& out) {
    const bool outer = doubled_area(contour) > 0;
    append(out, outer ? "    <polygon slic3r:type=\"contour\" points=\"" : "    <polygon slic3r:type=\"hole\" points=\"");
    append_written(out, contour.size() * (2 * kMostDecimal + 2), [&](char* text) {
      for (const Point2& p : contour) {
        if (&p != contour.data()) *text++ = ' ';
        text = put_perl_mm(p.x - std::int64_t{box.lo.x}, text);
        *text++ = ',';
        text = put_perl_mm(p.y - std::int64_t{box.lo.y}, text);
      }
      return text;
    });
    append(out, outer ? "\" style=\"fill: white\" />\n" : "\" style=\"fill: black\" />\n");
  }
};

}  // namespace

std::unique_ptr<SliceEncoder> make_svg_polygon_encoder() { return std::make_unique<SvgPolygonEncoder>(); }

}  // namespace lamina::write
