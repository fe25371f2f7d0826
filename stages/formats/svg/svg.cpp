#include "stages/formats/svg/svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "stages/formats/svg/svg_writer.h"
#include "stages/support/text/decimal.h"

namespace lamina::formats {

// Slices as Slic3r writes them; see README.md for every attribute.

namespace {

constexpr std::string_view kDeclaration =
    "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n"
    "<!DOCTYPE svg PUBLIC \"-//W3C//DTD SVG 1.0//EN\" \"http://www.w3.org/TR/2001/REC-SVG-20010904/DTD/svg10.dtd\">\n";

struct PathStyle {
  std::string_view name, colour;
};

PathStyle style_of(PathKind kind) {
  switch (kind) {
    case PathKind::kOuter: return {"outer", "#c0392b"};
    case PathKind::kInner: return {"inner", "#e67e22"};
    case PathKind::kRaster: return {"raster", "#2980b9"};
    case PathKind::kContour: return {"contour", "#16a085"};
    case PathKind::kLink: return {"link", "#8e44ad"};
    case PathKind::kSkirt: return {"skirt", "#7f8c8d"};
    case PathKind::kSolid: return {"solid", "#27408b"};
    case PathKind::kSupport: return {"support", "#95a5a6"};
  }
  return {"", "#000000"};
}

class SvgEncoder : public SliceEncoder {
 public:
  void head(const SliceHead& head, Buffer<char>& out) const override {
    append(out, kDeclaration);
    SvgWriter svg(out);
    svg.begin("svg");
    svg.millimetres("width", head.bounds.width());
    svg.millimetres("height", head.bounds.depth());
    svg.attribute("xmlns", "http://www.w3.org/2000/svg");
    svg.attribute("xmlns:svg", "http://www.w3.org/2000/svg");
    svg.attribute("xmlns:xlink", "http://www.w3.org/1999/xlink");
    svg.attribute("xmlns:slic3r", "http://slic3r.org/namespaces/slic3r");
    svg.attribute("viewport-fill", "black");
    svg.open();
    append(out, fmt::format("<!-- {}; millimetres; x 0 and y {:.6f} of the picture are x {:.6f} and y {:.6f} of the bed -->\n",
                            svg_escaped(head.program), mm(head.bounds.depth()), mm(head.bounds.lo.x), mm(head.bounds.lo.y)));
  }

  void layer(const SliceHead& head, const SliceLayer& layer, Buffer<char>& out) const override {
    const SvgFrame frame{head.bounds.lo.x, head.bounds.hi.y};
    SvgWriter svg(out, 1);
    svg.begin("g");
    svg.attribute("id", fmt::format("layer{}", layer.layer.index));
    svg.millimetres("slic3r:z", std::int64_t{layer.layer.bottom} + layer.layer.thickness);
    svg.millimetres("slic3r:slice-z", layer.layer.plane());
    svg.millimetres("slic3r:layer-height", layer.layer.thickness);
    svg.open();
    for (std::size_t b = 0; b + 1 < layer.body.size(); ++b) {
      for (std::uint32_t c = layer.body[b]; c < layer.body[b + 1];) c = put_region(head, frame, layer, b, c, svg);
    }
    for (std::uint32_t p = 0; p < layer.paths.size(); ++p) put_path(frame, layer.paths, p, svg);
    svg.close("g");
  }

  void tail(const SliceHead&, Buffer<char>& out) const override { SvgWriter(out, 1).close("svg"); }

 private:
  /// One element for an outer contour, the first, and the holes that follow it. returns the contour behind them
  static std::uint32_t put_region(const SliceHead& head, const SvgFrame& frame, const SliceLayer& layer, std::size_t b,
                                  std::uint32_t first, SvgWriter& svg) {
    svg.begin("path");
    svg.begin_data();
    __int128 area = 0;
    std::uint32_t c = first;
    for (; c < layer.body[b + 1]; ++c) {
      const auto contour = layer.contours[c];
      const __int128 own = doubled_area(contour);
      if (c > first && own > 0) break;
      area += own;
      svg.contour(contour, frame);
    }
    svg.end_data();
    svg.attribute("style", "fill: white; stroke: black; stroke-width: 0; fill-type: evenodd; fill-rule: evenodd");
    svg.attribute("slic3r:area", fmt::format("{:.4f}", square_mm(area)));
    if (head.parts.size() > 1) svg.attribute("class", svg_escaped(head.parts[b]));
    svg.end();
    return c;
  }

  /// One element for each stretch of one kind and width, as wide as its bead.
  static void put_path(const SvgFrame& frame, const ToolpathsView& paths, std::uint32_t p, SvgWriter& svg) {
    std::uint32_t begin = paths.offset[p];
    const std::uint32_t last = paths.offset[p + 1] - 1;
    while (begin < last) {
      std::uint32_t end = begin + 1;  // the stretch is begin .. end
      while (end < last && paths.kind[end] == paths.kind[begin] && paths.width[end] == paths.width[begin]) ++end;
      svg.begin("path");
      svg.begin_data();
      svg.line({&paths.point[begin], &paths.point[end] + 1}, frame);
      svg.end_data();
      const PathStyle style = style_of(paths.kind[begin]);
      svg.attribute("class", style.name);
      char width[kMaxDecimal];
      svg.attribute("style",
                    fmt::format("fill: none; stroke: {}; stroke-linecap: round; stroke-linejoin: round; stroke-width: {}",
                                style.colour, std::string_view(width, put_mm(paths.width[begin], width))));
      svg.end();
      begin = end;
    }
  }
};

}  // namespace

std::unique_ptr<SliceEncoder> make_svg_encoder() { return std::make_unique<SvgEncoder>(); }

// Slices as Slic3r 1.3 writes them with --export-svg, byte for byte but for the comment, since
// the hosts of powder printers that read them parse lines; see README.md for each. source  slic3r/Slic3r, tag 1.3.0
// (3ba8e0f), lib/Slic3r/Print.pm, export_svg

namespace {

/// A length as Perl prints it: mm, below 0.0001 with an exponent.
char* put_perl_mm(std::int64_t nm, char* out) {
  if (nm == 0 || std::abs(nm) >= 100) return put_mm(nm, out);
  return fmt::format_to(out, "{:.15g}", mm(nm));
}

std::string perl_mm(std::int64_t nm) {
  char text[kMaxDecimal];
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
    append(out, kDeclaration);
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
    append_written(out, contour.size() * (2 * kMaxDecimal + 2), [&](char* text) {
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

namespace {

void write_region(SvgWriter& svg, const SvgFrame& frame, const std::string& name, const Ink& ink, const Contours& contours) {
  svg.begin("path");
  svg.attribute("class", svg_escaped(name));
  svg.attribute("fill", fmt::format("#{:02x}{:02x}{:02x}", ink[0], ink[1], ink[2]));
  svg.attribute("fill-rule", "nonzero");
  svg.begin_data();
  for (std::uint32_t c = 0; c < contours.size(); ++c) svg.contour(contours[c], frame);
  svg.end_data();
  svg.end();
}

}  // namespace

std::string svg_drawing(const LayerShapes& shapes) {
  const Box& box = shapes.box;
  const std::int64_t margin = std::max(box.width(), box.depth()) / 50;
  const std::int64_t width = box.width() + 2 * margin, height = box.depth() + 2 * margin;
  const SvgFrame frame{box.lo.x - margin, box.hi.y + margin};
  Buffer<char> out;
  SvgWriter svg(out);
  svg.begin("svg");
  svg.attribute("xmlns", "http://www.w3.org/2000/svg");
  svg.millimetres("width", width, "mm");
  svg.millimetres("height", height, "mm");
  svg.attribute("viewBox", fmt::format("0 0 {} {}", mm(width), mm(height)));
  svg.open();
  svg.comment("drawn by lamina");
  write_region(svg, frame, "solid", {205, 209, 216}, shapes.contours);
  for (const LayerShapes::Beads& beads : shapes.beads) write_region(svg, frame, beads.name, beads.ink, beads.outline);
  svg.close("svg");
  return {out.begin(), out.end()};
}

}  // namespace lamina::formats
