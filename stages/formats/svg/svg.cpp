// stages/formats/svg/svg.cpp: slices as Slic3r writes them; see README.md for every attribute.
#include <fmt/format.h>

#include "stages/formats/slice_format.h"
#include "stages/formats/svg/svg_writer.h"
#include "stages/support/text/decimal.h"

namespace lamina::write {
namespace {

std::string_view colour_of(PathKind kind) {
  switch (kind) {
    case PathKind::kOuter: return "#c0392b";
    case PathKind::kInner: return "#e67e22";
    case PathKind::kRaster: return "#2980b9";
    case PathKind::kContour: return "#16a085";
    case PathKind::kLink: return "#8e44ad";
    case PathKind::kSkirt: return "#7f8c8d";
  }
  return "#000000";
}

std::string_view name_of(PathKind kind) {
  switch (kind) {
    case PathKind::kOuter: return "outer";
    case PathKind::kInner: return "inner";
    case PathKind::kRaster: return "raster";
    case PathKind::kContour: return "contour";
    case PathKind::kLink: return "link";
    case PathKind::kSkirt: return "skirt";
  }
  return "";
}

class SvgEncoder : public SliceEncoder {
 public:
  void head(const SliceHead& head, Buffer<char>& out) const override {
    append(out,
           "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n"
           "<!DOCTYPE svg PUBLIC \"-//W3C//DTD SVG 1.0//EN\" \"http://www.w3.org/TR/2001/REC-SVG-20010904/DTD/svg10.dtd\">\n");
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
      svg.attribute("class", name_of(paths.kind[begin]));
      char width[kMostDecimal];
      svg.attribute("style",
                    fmt::format("fill: none; stroke: {}; stroke-linecap: round; stroke-linejoin: round; stroke-width: {}",
                                colour_of(paths.kind[begin]), std::string_view(width, put_mm(paths.width[begin], width))));
      svg.end();
      begin = end;
    }
  }
};

}  // namespace

std::unique_ptr<SliceEncoder> make_svg_encoder() { return std::make_unique<SvgEncoder>(); }

}  // namespace lamina::write
